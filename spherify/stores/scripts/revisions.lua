-- Revision and place in the queue of each job. KEYS: 1 jobs:queued, 2.. records. ARGV: their ids.
local found = {}
for i = 2, #KEYS do
  found[i - 1] = {redis.call('HGET', KEYS[i], 'rev'), redis.call('ZRANK', KEYS[1], ARGV[i - 1])}
end
return found
