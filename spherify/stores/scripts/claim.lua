-- Arrow a, and c where the lease ran out. ARGV: 2 worker, 3 lease in ms, 4 most losses. Returns {outcome, token}.
local status = field('status')
if status == 'running' or status == 'cancelling' then
  if tonumber(field('lease_until')) > now() then return {'leased', 0} end
  local after = lose(tonumber(ARGV[4]))
  if after == 'failed' then return {'poisoned', 0} end
  if after ~= 'accepted' then return {'done', 0} end
elseif status ~= 'accepted' then
  return {'done', 0}
end
local token = redis.call('HINCRBY', JOB, 'token', 1)
redis.call('HINCRBY', JOB, 'attempt', 1)
redis.call('HSETNX', JOB, 'started_at', now() / 1000)
move('running')
redis.call('HSET', JOB, 'worker', ARGV[2])
lease(tonumber(ARGV[3]))
return {'claimed', token}
