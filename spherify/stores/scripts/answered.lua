-- The answer to a request under its Idempotency-Key, unless that was lost meanwhile. KEYS: 1 the key. ARGV: 1 answer.
if redis.call('EXISTS', KEYS[1]) == 0 then return 0 end
redis.call('HSET', KEYS[1], 'answer', ARGV[1])
redis.call('HDEL', KEYS[1], 'busy_until')
return 1
