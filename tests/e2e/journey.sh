#!/usr/bin/env bash
# The README's curl lines, as they stand there, against a running service; then more jobs than one worker can hold.
#
#   tests/e2e/journey.sh [BASE_URL]          makes a mesh, morphs it, downloads the result
#   tests/e2e/journey.sh [BASE_URL] --kept   only checks that what an earlier journey made is still there
#
# Needs bash, curl and any python3 (or PYTHON=…); leaves nothing behind on this side.
set -euo pipefail

readme=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)/README.md
base=${1:-http://127.0.0.1:8000}
python=${PYTHON:-python3}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

fail() { echo "journey: $*" >&2; exit 1; }
# field NAME.NAME… < JSON: one value of a document, as text
field() { "$python" -c 'import functools, json, sys
print(functools.reduce(lambda at, key: at[key], sys.argv[1].split("."), json.load(sys.stdin)))' "$1"; }
# readme_lines: the commands of the fence after the mark <!-- journey -->, meant for this service
readme_lines() {
  awk '/<!-- journey -->/ {mark = 1} mark && fence && /^```/ {exit} fence {print} mark && /^```bash/ {fence = 1}' "$readme" |
    grep '^curl ' | sed "s#http://localhost:8000#$base#g"
}
# await JOB: the job, once it is done
await() {
  for _ in $(seq 600); do
    curl -fsS -m 10 "$base/v1/jobs/$1" > await.json
    if grep -q '"done":true' await.json; then cat await.json; return; fi
    sleep 0.2
  done
  fail "$1 is not done: $(cat await.json)"
}

if [ "${2:-}" = --kept ]; then
  curl -fsS -m 10 "$base/v1/jobs?status=successful&limit=1" > jobs.json
  JOB=$("$python" -c 'import json; print(json.load(open("jobs.json"))["items"][0]["id"])') || fail "no job was kept"
  curl -fsS -m 10 -o kept.ply "$base/v1/jobs/$JOB/snapshots/final.ply"
  [ "$(head -c 3 kept.ply)" = ply ] || fail "the result of $JOB was not kept"
  echo "journey ok: $JOB and its result are still there"
  exit
fi

# A bumpy dumbbell: an octahedron, its triangles quartered three times, pushed in at the waist.
"$python" - > bunny.obj <<'PYTHON'
from math import cos, pi, sqrt

points = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
faces = [(4, 0, 2), (4, 2, 1), (4, 1, 3), (4, 3, 0), (5, 2, 0), (5, 1, 2), (5, 3, 1), (5, 0, 3)]
for _ in range(3):
    middles, finer = {}, []

    def middle(a, b):
        if frozenset((a, b)) not in middles:
            sums = [p + q for p, q in zip(points[a], points[b])]
            length = sqrt(sum(x * x for x in sums))
            points.append(tuple(x / length for x in sums))
            middles[frozenset((a, b))] = len(points) - 1
        return middles[frozenset((a, b))]

    for a, b, c in faces:
        ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
        finer += [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
    faces = finer
for x, y, z in points:
    r = 0.55 + 0.45 * x * x + 0.04 * cos(3 * pi * y) * cos(3 * pi * z)
    print("v", 1.6 * r * x, r * y, r * z)
for face in faces:
    print("f", *(corner + 1 for corner in face))
PYTHON

mapfile -t lines < <(readme_lines)
[ ${#lines[@]} -eq 3 ] || fail "the README has ${#lines[@]} curl lines, not 3"

echo "\$ ${lines[0]}"
bash -c "${lines[0]/curl /curl -fsS -m 60 }" > created.json || fail "the upload was refused"
JOB=$(field id < created.json)
export JOB
echo "\$ ${lines[1]}"
for _ in $(seq 600); do
  bash -c "${lines[1]/curl /curl -fsS -m 10 }" > job.json
  grep -q '"done":true' job.json && break
  sleep 0.2
done
[ "$(field status < job.json)" = successful ] || fail "$JOB ended as $(cat job.json)"
echo "\$ ${lines[2]}"
bash -c "${lines[2]/curl /curl -fsS -m 30 }"
saved=(bunny_it*.ply)
[ -s "${saved[0]}" ] && [ "$(head -c 3 "${saved[0]}")" = ply ] || fail "no PLY was saved: $(ls)"
psi=$(field metrics.sphericity < job.json)
"$python" -c "import sys; sys.exit(not $psi > 0.99)" || fail "sphericity $psi"

# Several at once: on a service with several workers they run side by side.
mesh=$(field mesh_id < created.json)
ids=()
for number in 1 2 3 4; do
  body="{\"mesh_id\": \"$mesh\", \"name\": \"twin-$number\", \"iterations\": 60, \"snapshots\": \"every:20\"}"
  ids+=("$(curl -fsS -m 10 -H 'Content-Type: application/json' -d "$body" "$base/v1/jobs" | field id)")
done
sums=()
for id in "${ids[@]}"; do
  [ "$(await "$id" | field status)" = successful ] || fail "$id did not succeed"
  sums+=("$(curl -fsS -m 10 "$base/v1/jobs/$id/snapshots/60.obj" | cksum)")
done
[ "$(printf '%s\n' "${sums[@]}" | sort -u | wc -l)" -eq 1 ] || fail "equal jobs gave different bytes"

echo "journey ok: $JOB after $(field progress.iteration < job.json) iterations at sphericity $psi, saved as ${saved[0]}; ${#ids[@]} equal jobs gave equal bytes"
