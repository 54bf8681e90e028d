-- A terminal job out of everything. KEYS: 6 tombstone, 7.. rows, snapshots. ARGV: 2 seconds of the tombstone, 3.. index keys.
local status = field('status')
if not status then return 'unknown' end
if status ~= 'successful' and status ~= 'failed' and status ~= 'cancelled' then return 'not-finished' end
redis.call('ZREM', BY_STATUS .. status, ID)
for i = 3, #ARGV do redis.call('ZREM', ARGV[i], ID) end
for i = 7, #KEYS do redis.call('DEL', KEYS[i]) end
redis.call('DEL', JOB)
redis.call('SET', KEYS[6], '1', 'EX', ARGV[2])
redis.call('ZADD', UNSETTLED, 0, ID)
return 'deleted'
