-- Arrow b or f: the end, once. ARGV: 2 token, 3 status, 4 the same with everything else as JSON, 5.. field, value, …
-- A repetition by the same attempt is 1 and changes nothing. Who asked to cancel before gets a cancelled job.
if field('committed') == ARGV[2] .. ARGV[4] then return 1 end
if not held(ARGV[2]) then return 0 end
for i = 5, #ARGV, 2 do redis.call('HSET', JOB, ARGV[i], ARGV[i + 1]) end
redis.call('HSET', JOB, 'committed', ARGV[2] .. ARGV[4])
if field('status') == 'cancelling' then
  redis.call('HDEL', JOB, 'error', 'stop_detail', 'result_iteration')
  finish_cancelled()
else
  finish(ARGV[3])
end
return 1
