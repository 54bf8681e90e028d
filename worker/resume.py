"""Where a job goes on: the newest intact state of any earlier attempt."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from spherify.geometry.schedule import SnapshotPlan
from spherify.jobs import layout
from spherify.jobs.model import Snapshot
from spherify.jobs.ports import BlobStat, BlobStore
from spherify.jobs.rows import BEST, Row
from spherify.stores.states import (
    FINGERPRINT,
    glances,
    load_state,
    row_of,
    rows_in,
    run_of,
    snapshot_record,
    trail_of,
)


@dataclass(frozen=True, eq=False, slots=True)
class Resumption:
    """What earlier attempts left.

    Attributes:
        arrays: the state to go on from; None to begin.
        snapshots: the planned snapshots up to that state, all intact, ascending.
        passed: the runs, by `run_of`, of the states that were looked at before; the one gone on with may be among them.

    """

    arrays: Mapping[str, NDArray[Any]] | None = None
    snapshots: tuple[Snapshot, ...] = ()
    passed: frozenset[bytes] = frozenset()

    @property
    def rows(self) -> list[Row]:
        """The time series up to that state."""
        return [] if self.arrays is None else rows_in(self.arrays)


def find_resumption(
    blobs: BlobStore, job_id: str, plan: SnapshotPlan, foreign: Collection[bytes] = ()
) -> Resumption:
    """Look through the files of all attempts; a damaged one counts as if it had never been written.

    The state found is the newest one before which no planned snapshot of the same run is missing, so that going on from
    it leaves the same files as a run that was never interrupted.

    Args:
        blobs: where the files are.
        job_id: whose.
        plan: iterations whose states are kept.
        foreign: runs that nobody can go on with, by `run_of`: their files count as if they had never been written.

    """
    public = _by_iteration(blobs, layout.snapshots(job_id))
    states = _by_iteration(blobs, layout.checkpoints(job_id))
    for iteration, stats in public.items():
        states[iteration] += stats
    kept: dict[bytes, tuple[list[Snapshot], float]] = {}
    passed: set[bytes] = set()
    for iteration in sorted(states, reverse=True):
        for stat in _newest_first(states[iteration]):
            loaded = load_state(blobs, stat)
            if loaded is None or not loaded[1].keys() & {BEST, FINGERPRINT}:
                continue  # a best state kept in hindsight leads nowhere, and says not whose it is
            run = run_of(loaded[1])
            passed.add(run)
            if run in foreign or BEST not in loaded[1] or not rows_in(loaded[1]):
                continue
            if run not in kept:
                kept[run] = _planned(blobs, plan, public, run)
            snapshots, gap = kept[run]
            if iteration < gap:
                taken = tuple(s for s in snapshots if s.iteration <= iteration)
                return Resumption(loaded[1], taken, frozenset(passed))
    return Resumption(passed=frozenset(passed))


def others_of_run(blobs: BlobStore, job_id: str, found: Resumption, run: bytes) -> tuple[Snapshot, ...]:
    """Return the further snapshots of the present run, most of them beyond one that is missing or damaged.

    They are made again, to the same bytes, and may be served until then.
    """
    named = {snapshot.iteration for snapshot in found.snapshots}
    states = [glance for glance in glances(blobs, job_id) if glance.run == run]
    return tuple(s for s in trail_of(blobs, states).snapshots if s.iteration not in named)


def _planned(
    blobs: BlobStore, plan: SnapshotPlan, public: Mapping[int, list[BlobStat]], run: bytes
) -> tuple[list[Snapshot], float]:
    """Return the planned snapshots of a run up to the first that is missing, and the iteration of that one."""
    snapshots: list[Snapshot] = []
    for iteration in plan.iterations:
        found = _intact_snapshot(blobs, iteration, public.get(iteration, []), run)
        if found is None:
            return snapshots, iteration
        snapshots.append(found)
    return snapshots, float("inf")


def _intact_snapshot(blobs: BlobStore, iteration: int, stats: list[BlobStat], run: bytes) -> Snapshot | None:
    for stat in _newest_first(stats):
        loaded = load_state(blobs, stat)
        if loaded is None or run_of(loaded[1]) != run:
            continue
        row = row_of(rows_in(loaded[1]), iteration)
        if row is not None:
            return snapshot_record(iteration, stat, loaded[0], row)
    return None


def _by_iteration(blobs: BlobStore, prefix: str) -> dict[int, list[BlobStat]]:
    found: dict[int, list[BlobStat]] = defaultdict(list)
    for stat in layout.numbered_only(blobs.list(prefix)):
        found[layout.numbers(stat.key)[1]].append(stat)
    return found


def _newest_first(stats: list[BlobStat]) -> list[BlobStat]:
    return sorted(stats, key=lambda stat: layout.numbers(stat.key), reverse=True)
