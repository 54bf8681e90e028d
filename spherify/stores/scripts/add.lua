-- A new job: submit -> accepted. ARGV: 2 spec, 3.. further index keys (all jobs, mesh, tags). 0 if it is known or deleted.
-- KEYS[5] is its tombstone.
if redis.call('EXISTS', JOB, KEYS[5]) > 0 then return 0 end
local at = now()
redis.call('HSET', JOB, 'spec', ARGV[2], 'status', 'accepted', 'rev', 0, 'token', 0, 'attempt', 0, 'losses', 0, 'queued_at', at)
redis.call('ZADD', QUEUED, at, ID)
for i = 3, #ARGV do redis.call('ZADD', ARGV[i], 0, ID) end
move('accepted')
return 1
