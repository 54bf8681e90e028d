-- Arrows d and e. What no attempt ever held has no file that says otherwise, and is cancelled here; what waits again is
-- left without a lease, to be ended by whoever claims it, and by none of its former attempts. A seal counts as long as
-- the lease of its attempt. KEYS: 6 epoch.
local status = field('status')
if not status then return redis.call('EXISTS', KEYS[6]) == 0 and 'incomplete' or 'unknown' end
if status == 'accepted' and field('token') == '0' then
  redis.call('HSET', JOB, 'stop_reason', 'cancelled')
  finish('cancelled')
  return 'cancelled'
end
if status == 'accepted' then
  redis.call('HINCRBY', JOB, 'token', 1)
  lease(0)
  move('cancelling')
  return 'cancelling'
end
if status == 'running' and not (field('sealed') and leased()) then
  move('cancelling')
  return 'cancelling'
end
if status == 'cancelling' or status == 'cancelled' then return status end
return 'finished'
