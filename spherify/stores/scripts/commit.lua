-- Arrow b or f: the end, once. KEYS: 6 snapshots, 7 rows. ARGV: 2 token, 3 status, 4 the same with everything
-- else as JSON, 5 the iterations of snapshots and of rows that stay, as two JSON lists, or '' for all, 6.. field, value, …
-- A repetition by the same attempt is 1 and changes nothing. 0 also if something that is to stay has not been told.
if field('committed') == ARGV[2] .. ARGV[4] then return 1 end
if not held(ARGV[2]) or ARGV[5] ~= '' and not told(ARGV[5]) then return 0 end
for i = 6, #ARGV, 2 do redis.call('HSET', JOB, ARGV[i], ARGV[i + 1]) end
if ARGV[5] ~= '' then keep(ARGV[5]) end -- what former attempts left and the end does not name goes
redis.call('HSET', JOB, 'committed', ARGV[2] .. ARGV[4])
finish(ARGV[3])
return 1
