-- A request again whose key was lost, without its answer. KEYS: 1 the key. ARGV: 1 fingerprint, 2 identity, 3 seconds it is kept.
if redis.call('EXISTS', KEYS[1]) > 0 then return 0 end
redis.call('HSET', KEYS[1], 'fingerprint', ARGV[1], 'identity', ARGV[2])
redis.call('EXPIRE', KEYS[1], ARGV[3])
return 1
