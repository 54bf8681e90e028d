-- Arrow a, and c where the lease ran out. ARGV: 2 worker, 3 lease in ms, 4 most losses, 5 claimant or ''.
-- Returns {outcome, token, milliseconds that earlier attempts held it, attempts with this one, losses}. Who asks
-- twice is told the same twice.
local function claimed() return {'claimed', field('token'), field('spent') or 0, field('attempt'), field('losses')} end
local status = field('status')
if status == 'running' or status == 'cancelling' then
  if tonumber(field('lease_until')) > now() then
    if ARGV[5] == '' or field('claimant') ~= ARGV[5] then return {'leased', 0, 0, 0, 0} end
    lease(tonumber(ARGV[3]))
    return claimed()
  end
  local after = lose(tonumber(ARGV[4]))
  if after == 'failed' then return {'poisoned', 0, 0, 0, 0} end
  if after ~= 'accepted' then return {'done', 0, 0, 0, 0} end
elseif status ~= 'accepted' then
  return {'done', 0, 0, 0, 0}
end
redis.call('HINCRBY', JOB, 'token', 1)
redis.call('HINCRBY', JOB, 'attempt', 1)
redis.call('HSETNX', JOB, 'started_at', now() / 1000)
move('running')
redis.call('HSET', JOB, 'worker', ARGV[2], 'claimant', ARGV[5], 'claimed_at', now())
lease(tonumber(ARGV[3]))
return claimed()
