-- The present attempt goes on from other states than former ones told of: what it does not name goes.
-- KEYS: 6 snapshots, 7 rows. ARGV: 2 token, 3 the iterations of snapshots and of rows that stay, as two JSON lists.
if not held(ARGV[2]) then return 0 end
keep(ARGV[3])
touch()
return 1
