-- Arrow c without a count: the worker hands the job on. ARGV: 2 token, 3 most losses. Returns the new status, '' if refused.
if not held(ARGV[2]) then return '' end
return hand_on(tonumber(ARGV[3]), 0)
