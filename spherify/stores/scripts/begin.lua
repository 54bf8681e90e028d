-- A request under its Idempotency-Key. KEYS: 1 the key, 2 epoch. ARGV: 1 fingerprint, 2 identity, 3 ms it may take, 4 seconds it is kept.
-- Returns {'begun', identity} | {'answered', identity, answer} | {'busy', ''} | {'reused', ''} |
-- {'incomplete', ''} while the key may be among what is being rebuilt.
local t = redis.call('TIME')
local now = tonumber(t[1]) * 1000 + math.floor(tonumber(t[2]) / 1000)
local fingerprint, identity, answer, busy_until =
  unpack(redis.call('HMGET', KEYS[1], 'fingerprint', 'identity', 'answer', 'busy_until'))
if not fingerprint and redis.call('EXISTS', KEYS[2]) == 0 then return {'incomplete', ''} end
if fingerprint and fingerprint ~= ARGV[1] then return {'reused', ''} end
if answer then return {'answered', identity, answer} end
if busy_until and tonumber(busy_until) > now then return {'busy', ''} end
identity = identity or ARGV[2]
redis.call('HSET', KEYS[1], 'fingerprint', ARGV[1], 'identity', identity, 'busy_until', now + ARGV[3])
redis.call('EXPIRE', KEYS[1], ARGV[4])
return {'begun', identity}
