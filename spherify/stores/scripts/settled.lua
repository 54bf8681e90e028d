-- The files are as they are to stay. ARGV: 2 'deleted' or 'ended', as what. 0 if the job is not that any more.
if (redis.call('EXISTS', JOB) == 0) ~= (ARGV[2] == 'deleted') then return 0 end
redis.call('ZREM', UNSETTLED, ID)
return 1
