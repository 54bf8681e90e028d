-- Become or stay the leader. KEYS: 1 leader. ARGV: 1 name, 2 milliseconds.
local present = redis.call('GET', KEYS[1])
if present and present ~= ARGV[1] then return 0 end
redis.call('SET', KEYS[1], ARGV[1], 'PX', ARGV[2])
return 1
