-- Arrows d and e.
local status = field('status')
if not status then return 'unknown' end
if status == 'accepted' then
  finish_cancelled()
  return 'cancelled'
end
if status == 'running' and not field('sealed') then
  move('cancelling')
  return 'cancelling'
end
if status == 'cancelling' or status == 'cancelled' then return status end
return 'finished'
