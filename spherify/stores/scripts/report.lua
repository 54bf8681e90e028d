-- Progress and rows of the present attempt. KEYS[6] rows. ARGV: 2 token, 3 progress, 4 newest figures or '', 5.. iteration, row, …
if not held(ARGV[2]) then return 0 end
redis.call('HSET', JOB, 'progress', ARGV[3])
if ARGV[4] ~= '' then redis.call('HSET', JOB, 'metrics', ARGV[4]) end
for i = 5, #ARGV, 2 do redis.call('HSET', KEYS[6], ARGV[i], ARGV[i + 1]) end
touch()
return 1
