-- A mesh whose files are durable; 0 if it was known. KEYS: 1 record, 2 meshes. ARGV: 1 id, 2 record, 3 seconds of creation.
if redis.call('SETNX', KEYS[1], ARGV[2]) == 0 then return 0 end
redis.call('ZADD', KEYS[2], ARGV[3], ARGV[1])
return 1
