-- A slice of the waiting messages, those that are taken last before the others. KEYS: the lists, in that order.
-- ARGV: 1 place of the first, 2 how many at most.
local place, left, found = tonumber(ARGV[1]), tonumber(ARGV[2]), {}
for _, list in ipairs(KEYS) do
  if left > 0 then
    for _, message in ipairs(redis.call('LRANGE', list, place, place + left - 1)) do
      found[#found + 1] = message
      left = left - 1
    end
  end
  place = math.max(place - redis.call('LLEN', list), 0)
end
return found
