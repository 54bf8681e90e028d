-- Arrow c. ARGV: 2 token, or '' for whoever's lease ran out; 3 most losses, 4 how many this is: 1,
-- or 0 if nobody is to blame. Returns the new status, '' if refused.
if ARGV[2] ~= '' then
  if not held(ARGV[2]) then return '' end
else
  if not field('lease_until') then redis.call('ZREM', LEASES, ID) return '' end
  if leased() then return '' end
end
return hand_on(tonumber(ARGV[3]), tonumber(ARGV[4]))
