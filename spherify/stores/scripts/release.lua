-- Arrow c without a count: the worker hands the job on. ARGV: 2 token. A job to be cancelled is cancelled instead.
if not held(ARGV[2]) then return 0 end
hand_on()
return 1
