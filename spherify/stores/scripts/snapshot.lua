-- A snapshot whose file is durable. KEYS[6] snapshots. ARGV: 2 token, 3 iteration, 4 snapshot.
if not held(ARGV[2]) then return 0 end
redis.call('HSET', KEYS[6], ARGV[3], ARGV[4])
touch()
return 1
