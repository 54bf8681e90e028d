-- A mesh no job names, once all jobs are known. KEYS: 1 record, 2 meshes, 3 the jobs that name it, 4 epoch. ARGV: 1 id.
if redis.call('EXISTS', KEYS[4]) == 0 then return 'incomplete' end
if redis.call('ZCARD', KEYS[3]) > 0 then return 'in-use' end -- also if the record was lost: its files are needed
if redis.call('EXISTS', KEYS[1]) == 0 then return 'unknown' end
redis.call('DEL', KEYS[1])
redis.call('ZREM', KEYS[2], ARGV[1])
return 'deleted'
