-- Arrow a, and c where the lease ran out. ARGV: 2 worker, 3 lease in ms, 4 most losses, 5 claimant or '', 6 '1' to take
-- nothing but what is to be ended.
-- Returns {outcome, token, milliseconds that earlier attempts held it, attempts, losses}: 'claimed', to be computed, or
-- 'ending', which is no attempt: it is to be cancelled, or was lost too often. Who asks twice is told the same twice.
local MOST = tonumber(ARGV[4])
local function lost_too_often() return tonumber(field('losses')) > MOST end
local function ending() return field('status') == 'cancelling' or lost_too_often() end
local function taken()
  return {ending() and 'ending' or 'claimed', field('token'), field('spent') or 0, field('attempt'), field('losses')}
end
local status = field('status')
if status == 'running' or status == 'cancelling' then
  if leased() then
    if ARGV[5] == '' or field('claimant') ~= ARGV[5] then return {'leased', 0, 0, 0, 0} end
    lease(tonumber(ARGV[3]))
    return taken()
  end
  if ARGV[6] == '1' and not ending() then return {'leased', 0, 0, 0, 0} end
  if status == 'running' and not lost_too_often() then redis.call('HINCRBY', JOB, 'losses', 1) end
  let_go()
elseif status ~= 'accepted' or ARGV[6] == '1' then
  return {'done', 0, 0, 0, 0}
end
redis.call('HINCRBY', JOB, 'token', 1)
if not ending() then
  redis.call('HINCRBY', JOB, 'attempt', 1)
  redis.call('HSETNX', JOB, 'started_at', now() / 1000)
end
if status == 'cancelling' then touch() else move('running') end
redis.call('HSET', JOB, 'worker', ARGV[2], 'claimant', ARGV[5], 'claimed_at', now())
lease(tonumber(ARGV[3]))
return taken()
