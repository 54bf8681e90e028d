"""The scripts and the twin in memory, taken through the same random lives: same answers, same records, legal moves."""

from __future__ import annotations

import dataclasses

import redis
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    Bundle,
    RuleBasedStateMachine,
    consumes,
    invariant,
    rule,
    run_state_machine_as_test,
)

from spherify.jobs.model import LEGAL_MOVES, Job, JobStatus, Outcome, Progress, Snapshot
from spherify.jobs.ports import ClaimOutcome, Kept
from spherify.stores import keys
from spherify.stores.memory import MemoryJobStore
from spherify.stores.memory_meshes import MemoryMeshStore
from spherify.stores.redis_jobs import RedisJobStore
from spherify.stores.redis_meshes import RedisMeshStore
from tests.jobs.examples import job_spec, mesh_record

TIMES = {"lease_until": None, "started_at": None, "finished_at": None, "rev": 0, "error": None}
MAX_LOSSES = 2


def test_every_life_of_a_job_is_the_same_in_both_stores(client: redis.Redis) -> None:
    class Lives(RuleBasedStateMachine):
        ids = Bundle("ids")

        def __init__(self) -> None:
            super().__init__()
            client.flushall()
            client.set(keys.EPOCH, "test")
            self.real = RedisJobStore(client, lease_s=60, max_losses=MAX_LOSSES)
            self.brief = RedisJobStore(client, lease_s=-1, max_losses=MAX_LOSSES)
            self.twin = MemoryJobStore(lease_s=60, max_losses=MAX_LOSSES)
            for meshes in (RedisMeshStore(client), MemoryMeshStore(self.twin)):
                meshes.add(mesh_record())
            self.seen: dict[str, Job] = {}

        @rule(target=ids)
        def add(self) -> str:
            spec = job_spec()
            self.real.add(spec)
            self.twin.add(spec)
            return spec.id

        @rule(job_id=ids, brief=st.booleans(), to_end=st.booleans())
        def claim(self, job_id: str, brief: bool, to_end: bool) -> None:
            self.twin._lease_s = -1 if brief else 60
            store = self.brief if brief else self.real
            claims = [jobs.claim(job_id, "w", to_end=to_end) for jobs in (store, self.twin)]
            assert claims[0] == claims[1]
            assert (claims[0].attempt, claims[0].losses) == (claims[1].attempt, claims[1].losses)
            assert not (to_end and claims[0].outcome is ClaimOutcome.CLAIMED)

        @rule(job_id=ids, token=st.integers(1, 4))
        def renew(self, job_id: str, token: int) -> None:
            self.twin._lease_s = 60
            assert self.real.renew(job_id, token) == self.twin.renew(job_id, token)

        @rule(job_id=ids, token=st.integers(1, 4), iteration=st.integers(0, 3))
        def report(self, job_id: str, token: int, iteration: int) -> None:
            progress, rows = Progress(iteration, 3), [{"iteration": iteration, "sphericity": 0.5}]
            snapshot = Snapshot(iteration, "k", "s", 1, {}, 1.0)
            for call in ("report", "add_snapshot"):
                args = (progress, rows) if call == "report" else (snapshot,)
                assert getattr(self.real, call)(job_id, token, *args) == getattr(self.twin, call)(
                    job_id, token, *args
                )

        @rule(job_id=ids, token=st.integers(1, 4), kept=st.sets(st.integers(0, 3)))
        def disown(self, job_id: str, token: int, kept: set[int]) -> None:
            stay = Kept(frozenset(kept), frozenset(kept - {1}))
            assert self.real.disown(job_id, token, stay) == self.twin.disown(job_id, token, stay)

        @rule(job_id=ids, token=st.integers(1, 4), call=st.sampled_from(["release", "lose"]))
        def give_up(self, job_id: str, token: int, call: str) -> None:
            assert getattr(self.real, call)(job_id, token) == getattr(self.twin, call)(job_id, token)

        @rule(
            job_id=ids,
            token=st.integers(1, 4),
            status=st.sampled_from([JobStatus.SUCCESSFUL, JobStatus.FAILED, JobStatus.CANCELLED]),
        )
        def commit(self, job_id: str, token: int, status: JobStatus) -> None:
            outcome = Outcome(status, "converged", result_iteration=1, best_iteration=1)
            assert self.real.commit(job_id, token, outcome) == self.twin.commit(job_id, token, outcome)

        @rule(job_id=ids, token=st.integers(1, 4))
        def seal(self, job_id: str, token: int) -> None:
            assert self.real.seal(job_id, token) == self.twin.seal(job_id, token)

        @rule(job_id=ids, deleted=st.booleans())
        def settled(self, job_id: str, deleted: bool) -> None:
            assert self.real.settled(job_id, deleted=deleted) == self.twin.settled(job_id, deleted=deleted)

        @rule(job_id=ids)
        def cancel(self, job_id: str) -> None:
            assert self.real.request_cancel(job_id) == self.twin.request_cancel(job_id)

        @rule(counted=st.booleans())
        def lost(self, counted: bool) -> None:
            assert sorted(self.real.lost(counted=counted)) == sorted(self.twin.lost(counted=counted))

        @rule(job_id=consumes(ids))
        def delete(self, job_id: str) -> None:
            if self.twin.get(job_id).status.done:
                self.real.delete(job_id)
                self.twin.delete(job_id)
                self.seen.pop(job_id, None)

        @invariant()
        def records_are_the_same_and_moved_legally(self) -> None:
            assert self.real.counts() == self.twin.counts()
            assert self.real.waiting(0) == self.twin.waiting(0)
            assert self.real.unsettled() == self.twin.unsettled()
            assert sorted(self.real.overdue()) == sorted(self.twin.overdue())
            for job in self.real.find(limit=1000).items:
                twin = self.twin.get(job.id)
                assert dataclasses.replace(job, **TIMES) == dataclasses.replace(twin, **TIMES)
                assert (job.error is None) == (twin.error is None)
                assert self.real.metrics(job.id) == self.twin.metrics(job.id)
                before = self.seen.get(job.id)
                if before is not None and before.status is not job.status:
                    self.check_moves(before, job)
                assert before is None or job.rev >= before.rev
                self.seen[job.id] = job

        @staticmethod
        def check_moves(before: Job, after: Job) -> None:
            # a claim of a dead lease makes two moves at once: back, and on again
            through = {after.status} | ({JobStatus.ACCEPTED} if after.losses > before.losses else set())
            assert LEGAL_MOVES[before.status] & through

    run_state_machine_as_test(
        Lives, settings=settings(max_examples=15, stateful_step_count=25, deadline=None, database=None)
    )
