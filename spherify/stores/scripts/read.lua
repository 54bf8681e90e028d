-- Jobs as they are at this moment. Of each: its revision and place in the queue, and, unless that revision is known,
-- its fields and snapshots (a JSON list); 1 if it was deleted, 0 if it may be among those that come back, false if it is
-- not there. Fewer answers than jobs where there are too many snapshots for one call: the rest is to be asked for again.
-- KEYS: 1 jobs:queued, 2 epoch, then of each job its record, snapshots and tombstone.
-- ARGV: 1 snapshots after which no further job is read; of each job its id and the known revision, or ''.
local found, left = {}, tonumber(ARGV[1])
local complete = redis.call('EXISTS', KEYS[2]) == 1
local function absent(gone)
  if redis.call('EXISTS', gone) == 1 then return 1 end
  return not complete and 0
end
for i = 1, (#ARGV - 1) / 2 do
  if left <= 0 then break end
  local record, snapshots, gone = KEYS[3 * i], KEYS[3 * i + 1], KEYS[3 * i + 2]
  local id, known = ARGV[2 * i], ARGV[2 * i + 1]
  local rev = redis.call('HGET', record, 'rev')
  if not rev then
    found[i] = absent(gone)
  elseif rev == known then
    found[i] = {rev, redis.call('ZRANK', KEYS[1], id)}
  else
    local fields, kept = redis.call('HGETALL', record), redis.call('HVALS', snapshots)
    left = left - #kept
    found[i] = {rev, redis.call('ZRANK', KEYS[1], id), fields, '[' .. table.concat(kept, ',') .. ']'}
  end
end
return found
