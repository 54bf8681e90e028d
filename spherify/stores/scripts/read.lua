-- One job as it is at this moment: its revision and place in the queue, and, unless that revision is known, its
-- fields and snapshots; nothing if there is no such job.
-- KEYS: 1 record, 2 jobs:queued, 3 snapshots. ARGV: 1 id, 2 known revision, or ''.
local rev = redis.call('HGET', KEYS[1], 'rev')
if not rev then
  return false
end
local position = redis.call('ZRANK', KEYS[2], ARGV[1])
if rev == ARGV[2] then
  return {rev, position}
end
return {rev, position, redis.call('HGETALL', KEYS[1]), redis.call('HVALS', KEYS[3])}
