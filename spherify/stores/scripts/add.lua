-- A new job: submit -> accepted. ARGV: 2 spec, 3.. further index keys (all jobs, mesh, tags). 'known' also if it was deleted.
-- KEYS: 6 its tombstone, 7 the record of its mesh, 8 epoch.
if redis.call('EXISTS', JOB, KEYS[6]) > 0 then return 'known' end
if redis.call('EXISTS', KEYS[7]) == 0 then return redis.call('EXISTS', KEYS[8]) == 0 and 'incomplete' or 'no-mesh' end
local at = now()
redis.call('HSET', JOB, 'spec', ARGV[2], 'status', 'accepted', 'rev', 0, 'token', 0, 'attempt', 0, 'losses', 0, 'queued_at', at)
redis.call('ZADD', QUEUED, at, ID)
for i = 3, #ARGV do redis.call('ZADD', ARGV[i], 0, ID) end
move('accepted')
redis.call('HSET', JOB, 'rev', 1)
return 'added'
