-- A job again whose record was lost. KEYS: 6 its tombstone, 7 rows, 8 snapshots, 9 rebuild, 10 epoch.
-- ARGV: 2 the record, 3 rows, 4 snapshots (each a JSON object of strings), 5 the least token,
-- 6 the era its files were read in, or '' for any, 7.. index keys.
local era = redis.call('GET', KEYS[10]) or redis.call('GET', KEYS[9])
if ARGV[6] ~= '' and era ~= ARGV[6] then return 0 end -- it may have been deleted, and its tombstone be lost
if redis.call('EXISTS', JOB, KEYS[6]) > 0 then return 0 end
for i, key in ipairs({JOB, KEYS[7], KEYS[8]}) do
  for name, value in pairs(cjson.decode(ARGV[i + 1])) do redis.call('HSET', key, name, value) end
end
local fresh = string.format('%.0f', math.max(now(), tonumber(ARGV[5]))) -- beyond whatever was given out before
redis.call('HSET', JOB, 'rev', 0, 'token', fresh)
touch()
for i = 7, #ARGV do redis.call('ZADD', ARGV[i], 0, ID) end
if field('status') == 'accepted' then
  redis.call('ZADD', QUEUED, field('queued_at'), ID)
else
  redis.call('ZADD', UNSETTLED, 0, ID)
end
move(field('status'))
return 1
