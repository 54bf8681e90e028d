-- Jobs as they are at this moment. Of each: its revision and place in the queue, and, unless that revision is known,
-- its fields and snapshots; 1 if it was deleted, false if it is not there.
-- KEYS: 1 jobs:queued, then of each job its record, snapshots and tombstone.
-- ARGV: of each job its id and the known revision, or ''.
local found = {}
for i = 1, #ARGV / 2 do
  local record, snapshots, gone = KEYS[3 * i - 1], KEYS[3 * i], KEYS[3 * i + 1]
  local id, known = ARGV[2 * i - 1], ARGV[2 * i]
  local rev = redis.call('HGET', record, 'rev')
  if not rev then
    found[i] = redis.call('EXISTS', gone) == 1 and 1
  elseif rev == known then
    found[i] = {rev, redis.call('ZRANK', KEYS[1], id)}
  else
    local fields, kept = redis.call('HGETALL', record), redis.call('HVALS', snapshots)
    found[i] = {rev, redis.call('ZRANK', KEYS[1], id), fields, kept}
  end
end
return found
