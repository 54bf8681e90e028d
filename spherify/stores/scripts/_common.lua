-- Put before every script of jobs. KEYS: 1 the record, 2 jobs:queued, 3 jobs:leases, 4 jobs:unsettled,
-- 5 jobs:status: (a prefix). ARGV[1] is the job's id. The letters of the arrows are those of spherify/jobs/model.py.
local JOB, QUEUED, LEASES, UNSETTLED, BY_STATUS, ID = KEYS[1], KEYS[2], KEYS[3], KEYS[4], KEYS[5], ARGV[1]

local function microseconds() -- by the server's clock only
  local t = redis.call('TIME')
  return tonumber(t[1]) * 1000000 + tonumber(t[2])
end

local function now() return math.floor(microseconds() / 1000) end -- milliseconds

local function field(name) return redis.call('HGET', JOB, name) end

-- A revision beyond all that anybody saw, also if an older copy of the record was put back since: so many scripts do not
-- run in a microsecond.
local function touch()
  redis.call('HSET', JOB, 'rev', string.format('%.0f', math.max(tonumber(field('rev')) + 1, microseconds())))
end

local function let_go() -- of whoever held it
  redis.call('ZREM', LEASES, ID)
  local since = field('claimed_at')
  if since then redis.call('HINCRBY', JOB, 'spent', now() - since) end
  redis.call('HDEL', JOB, 'lease_until', 'worker', 'sealed', 'claimant', 'claimed_at')
end

local function move(to) -- to another status, and out of what the old one stood in
  local from = field('status')
  redis.call('ZREM', BY_STATUS .. from, ID)
  redis.call('ZADD', BY_STATUS .. to, 0, ID)
  redis.call('HSET', JOB, 'status', to)
  if to ~= 'accepted' then redis.call('ZREM', QUEUED, ID) end
  if to ~= 'running' and to ~= 'cancelling' then let_go() end
  touch()
end

local function finish(status)
  redis.call('HSET', JOB, 'finished_at', now() / 1000)
  redis.call('ZADD', UNSETTLED, 0, ID)
  move(status)
end

local function lease(ms)
  local till = now() + ms
  redis.call('ZADD', LEASES, till, ID)
  redis.call('HSET', JOB, 'lease_until', till)
end

local function held(token) -- whether this attempt is the present one and still at work
  local status = field('status')
  return (status == 'running' or status == 'cancelling') and field('token') == token
end

local function leased() return tonumber(field('lease_until')) > now() end

-- Arrow c, with one more loss counted or none, of so many at most. Returns the new status. A job that is not to be
-- computed any more, being cancelled or lost too often, keeps the one it has, without a lease: whoever claims it ends it,
-- by its file first.
local function hand_on(most, more)
  local losses, cancelling = tonumber(field('losses')), field('status') == 'cancelling'
  if more > 0 and not cancelling and losses <= most then
    losses = redis.call('HINCRBY', JOB, 'losses', more)
    redis.call('HINCRBY', JOB, 'token', 1) -- the worker may only have slept
    touch()
  end
  if cancelling or losses > most then
    lease(0)
    return field('status')
  end
  redis.call('ZADD', QUEUED, field('queued_at'), ID)
  move('accepted')
  return 'accepted'
end

-- Whether all that is named was told, and not by a record that an older copy replaced. As `keep`.
local function told(named)
  for i, iterations in ipairs(cjson.decode(named)) do
    for _, iteration in ipairs(iterations) do
      if redis.call('HEXISTS', KEYS[5 + i], iteration) == 0 then return false end
    end
  end
  return true
end

-- Of what attempts told, only what is named stays. KEYS: 6 snapshots, 7 rows. Takes the iterations of both, two JSON lists.
local function keep(named)
  for i, iterations in ipairs(cjson.decode(named)) do
    local kept = {}
    for _, iteration in ipairs(iterations) do kept[iteration] = true end
    for _, iteration in ipairs(redis.call('HKEYS', KEYS[5 + i])) do
      if not kept[iteration] then redis.call('HDEL', KEYS[5 + i], iteration) end
    end
  end
end
