-- The last look before the end is written: from now on a cancel comes too late. ARGV: 2 token.
if not held(ARGV[2]) then return 'fenced' end
if field('status') == 'cancelling' then return 'cancel' end
redis.call('HSET', JOB, 'sealed', 1)
return 'held'
