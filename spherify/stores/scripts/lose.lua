-- Arrow c. ARGV: 2 token, or '' for whoever's lease ran out; 3 most losses, or '' for no count. Returns the new status, '' if refused.
if ARGV[2] ~= '' then
  if not held(ARGV[2]) then return '' end
else
  local till = field('lease_until')
  if not till then redis.call('ZREM', LEASES, ID) return '' end
  if tonumber(till) > now() then return '' end
end
if ARGV[3] == '' then return hand_on() end
return lose(tonumber(ARGV[3]))
