-- The records are complete, perhaps by another who rebuilt them as well; 0 if they were lost again meanwhile.
-- KEYS: 1 rebuild, 2 epoch. ARGV: 1 name of the rebuild.
if redis.call('GET', KEYS[2]) == ARGV[1] then return 1 end
if redis.call('GET', KEYS[1]) ~= ARGV[1] then return 0 end
redis.call('RENAME', KEYS[1], KEYS[2])
return 1
