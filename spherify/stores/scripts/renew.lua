-- Heartbeat. ARGV: 2 token, 3 lease in ms.
if not held(ARGV[2]) then return 'fenced' end
lease(tonumber(ARGV[3]))
if field('status') == 'cancelling' then return 'cancel' end
return 'held'
