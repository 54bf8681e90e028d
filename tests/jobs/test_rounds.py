"""The rounds of the reconciler, over the twins in memory: which silence is an outage of the server, which is not."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import BinaryIO

import numpy as np
import pytest

from spherify.jobs import layout
from spherify.jobs.codec import dump_record
from spherify.jobs.errors import StoreUnavailableError
from spherify.jobs.model import JobStatus, Outcome
from spherify.jobs.reconcile import Reconciler
from spherify.jobs.submit import submit
from spherify.stores.arrays import dump_arrays
from spherify.stores.memory import MemoryJobStore
from spherify.stores.memory_blobs import MemoryBlobStore
from spherify.stores.reconciler import Rounds
from tests.jobs.examples import job_spec
from tests.jobs.world import World

LEASE_S = 30.0  # the world's


class Away(MemoryBlobStore):
    """Files that cannot be reached."""

    def read(self, key: str) -> bytes:
        raise StoreUnavailableError


def lost_job(world: World) -> str:
    """Return a job whose worker has just vanished."""
    spec = job_spec()
    submit(world.jobs, world.blobs, world.queue, spec)
    world.jobs.claim(world.queue.take(), "w")
    return spec.id


def rounds_of(world: World, *, period_s: float) -> Rounds:
    reconciler = Reconciler(world.stock, orphan_s=15)
    return Rounds(reconciler, lambda: True, lease_s=LEASE_S, period_s=period_s, clock=lambda: world.now[0])


def losses_after(world: World, rounds: Rounds, job_id: str, pauses: list[float]) -> int:
    for pause in pauses:
        world.now[0] += pause
        rounds.go()
    return world.jobs.get(job_id).losses


@pytest.mark.parametrize("period_s", [5.0, 20.0, 60.0])
def test_the_pause_between_two_rounds_is_no_outage(world: World, period_s: float) -> None:
    job_id = lost_job(world)
    rounds = rounds_of(world, period_s=period_s)
    assert losses_after(world, rounds, job_id, [period_s] * round(LEASE_S / period_s + 1)) == 1
    assert world.queue.pending() == [job_id]


def test_a_server_that_was_away_for_half_a_lease_costs_no_loss(world: World) -> None:
    job_id = lost_job(world)
    rounds = rounds_of(world, period_s=5)
    assert losses_after(world, rounds, job_id, [31, 5]) == 0
    assert world.queue.pending() == [job_id]


def test_files_that_are_away_are_no_outage_of_the_server(world: World) -> None:
    ended = lost_job(world)
    world.jobs.commit(ended, 1, Outcome(JobStatus.FAILED))  # it is to be settled, which takes files
    world.blobs = Away(world.blobs.scratch())
    rounds = rounds_of(world, period_s=5)
    job_id = lost_job(world)
    for _ in range(7):
        world.now[0] += 5
        with pytest.raises(StoreUnavailableError):
            rounds.go()
    assert world.jobs.get(job_id).losses == 1
    assert world.queue.pending() == [job_id]


def test_whoever_did_not_lead_after_an_outage_counts_losses_when_it_does(world: World) -> None:
    post = [False]
    reconciler = Reconciler(world.stock, orphan_s=15)
    rounds = Rounds(reconciler, lambda: post[0], lease_s=LEASE_S, period_s=5, clock=lambda: world.now[0])
    world.now[0] += 60
    rounds.go()
    job_id = lost_job(world)
    assert losses_after(world, rounds, job_id, [5] * 7) == 0, "that is the leader's to say"
    post[0] = True
    assert losses_after(world, rounds, job_id, [5]) == 1


def test_a_rebuild_that_takes_long_over_one_job_keeps_the_post(world: World) -> None:
    """The post is another's after three periods in which nobody asked for it."""

    class Slow(MemoryBlobStore):
        def open(self, key: str) -> BinaryIO:
            world.now[0] += 2.0
            return super().open(key)

    class Forgetful(MemoryJobStore):
        def complete(self) -> bool:
            return False

    spec, blobs = job_spec(), Slow(world.blobs.scratch())
    blobs.create(layout.spec(spec.id), dump_record(spec).encode())
    state = dump_arrays({"vertices": np.zeros((3, 3))})
    for iteration in range(20):
        blobs.create(layout.numbered(layout.snapshots(spec.id), 1, iteration), state)
    forgetful = Forgetful(clock=lambda: world.now[0])
    asked = [world.now[0]]

    def lead() -> bool:
        asked.append(world.now[0])
        return True

    stock = replace(world.stock, jobs=forgetful, blobs=blobs)
    Rounds(
        Reconciler(stock, orphan_s=15), lead, lease_s=LEASE_S, period_s=5.0, clock=lambda: world.now[0]
    ).go()
    asked.append(world.now[0])
    assert forgetful.unknown([spec.id]) == []
    assert max(later - earlier for earlier, later in pairwise(asked)) < 3 * 5.0
    assert len(asked) < (world.now[0] - asked[0]) / 4, "and not for each file, of which one is opened in 2 s"
