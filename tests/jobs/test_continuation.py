"""Jobs that go on from where another ended, over the twins in memory."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from spherify.geometry.errors import InvalidConfigError
from spherify.jobs import layout
from spherify.jobs.codec import dump_record, load_spec
from spherify.jobs.continuation import (
    extension,
    may_be_extended,
    may_be_retried,
    repetition,
    submit_continuation,
)
from spherify.jobs.errors import (
    JobCannotGoOnError,
    JobGoneError,
    JobNotFinishedError,
    MeshNotFoundError,
)
from spherify.jobs.ids import new_job_id
from spherify.jobs.model import Job, JobStatus, Snapshot
from spherify.stores.memory import MemoryJobStore
from spherify.stores.memory_blobs import MemoryBlobStore
from spherify.stores.memory_meshes import MemoryJobQueue, MemoryMeshStore
from tests.jobs.examples import MESH_ID, job_spec, mesh_record

CHILD, _ = new_job_id()


def snapshot(job_id: str, iteration: int) -> Snapshot:
    key = layout.numbered(layout.snapshots(job_id), 1, iteration)
    return Snapshot(iteration, key, "0" * 64, 1, {"sphericity": 0.5}, 1.0)


def ended(
    status: JobStatus = JobStatus.SUCCESSFUL,
    reason: str | None = "iterations",
    kept: tuple[int, ...] = (0, 100, 300, 1000),
) -> Job:
    """A job of 1000 iterations whose best state, 300, was kept in hindsight."""
    spec = job_spec(iterations=1000, snapshots="100,500", tags=("t",))
    return Job(spec, status, stop_reason=reason, snapshots=tuple(snapshot(spec.id, i) for i in kept))


def test_an_extension_counts_on_and_takes_the_planned_states_over() -> None:
    parent = ended()
    child = extension(parent, CHILD, 200, "every:100")
    assert child.snapshots_requested == (0, 100, 1000, 1100, 1200)
    assert child.parameters == parent.spec.parameters | {"iterations": 1200}
    assert (child.id, child.parent_id, child.mesh_id) == (CHILD, parent.id, parent.spec.mesh_id)
    assert (child.name, child.tags, child.preset) == (parent.spec.name, ("t",), "robust")
    assert load_spec(dump_record(child)) == child


@pytest.mark.parametrize(
    ("wanted", "new"),
    [
        ([1100, 1150], {1100, 1150, 1200}),
        ("50,1100", {1100, 1200}),
        ("log:3", {1001, 1014, 1200}),
        ("", {1200}),
    ],
)
def test_plans_of_an_extension(wanted: str | list[int], new: set[int]) -> None:
    assert set(extension(ended(), CHILD, 200, wanted).snapshots_requested) == {0, 100, 1000} | new


@pytest.mark.parametrize("wanted", [[1300], "every:0", "nonsense"])
def test_wrong_plans(wanted: str | list[int]) -> None:
    with pytest.raises(InvalidConfigError):
        extension(ended(), CHILD, 200, wanted)


def test_both_together_keep_no_more_than_one_job_may() -> None:
    parent = ended(kept=tuple(range(0, 1000, 2)))
    parent = replace(parent, spec=replace(parent.spec, snapshots_requested=tuple(range(0, 1000, 2))))
    with pytest.raises(InvalidConfigError, match="at most 1000"):
        extension(parent, CHILD, 600, "every:1")


def test_a_cancelled_job_goes_on_where_it_was_stopped() -> None:
    parent = ended(JobStatus.CANCELLED, "cancelled", kept=(0, 100, 137))
    assert extension(parent, CHILD, 100, "150").snapshots_requested == (0, 100, 137, 150, 237)
    again = repetition(parent, CHILD)
    assert again.snapshots_requested == parent.spec.snapshots_requested
    assert again.parameters == parent.spec.parameters
    nothing = ended(JobStatus.CANCELLED, "cancelled", kept=())
    assert extension(nothing, CHILD, 10, "").snapshots_requested == (0, 10)


@pytest.mark.parametrize("reason", ["converged", "stalled", "constant-curvature", "collapsed"])
def test_what_ended_by_itself_would_end_there_again(reason: str) -> None:
    parent = ended(JobStatus.FAILED if reason == "collapsed" else JobStatus.SUCCESSFUL, reason)
    assert not may_be_extended(parent)
    with pytest.raises(JobCannotGoOnError, match=reason):
        extension(parent, CHILD, 10, "")
    assert not may_be_retried(parent)
    with pytest.raises(JobCannotGoOnError):
        repetition(parent, CHILD)


def test_only_ended_jobs_go_on_and_only_unsuccessful_ones_are_retried() -> None:
    running = ended(JobStatus.RUNNING, None)
    with pytest.raises(JobNotFinishedError):
        extension(running, CHILD, 10, "")
    with pytest.raises(JobNotFinishedError):
        repetition(running, CHILD)
    with pytest.raises(JobCannotGoOnError, match="successful"):
        repetition(ended(), CHILD)
    assert may_be_retried(ended(JobStatus.FAILED, "deadline"))
    assert may_be_retried(ended(JobStatus.FAILED, None)), "its worker was lost too often"


class World:
    def __init__(self, folder: Path) -> None:
        self.jobs = MemoryJobStore(lease_s=30, max_losses=1, clock=lambda: 1.0)
        MemoryMeshStore(self.jobs).add(mesh_record())
        self.blobs = MemoryBlobStore(folder)
        self.queue = MemoryJobQueue()
        self.parent = ended(JobStatus.CANCELLED, "cancelled", kept=(0, 100, 137))
        self.jobs.add(self.parent.spec)
        for kept in self.parent.snapshots:
            self.blobs.create(kept.key, str(kept.iteration).encode())

    def submit(self, spec: object) -> Job:
        return submit_continuation(self.jobs, self.blobs, self.queue, self.parent, spec)  # type: ignore[arg-type]

    def files(self) -> dict[str, bytes]:
        found = [stat.key for stat in self.blobs.list(layout.job_folder(CHILD))]
        return {key.removeprefix(layout.job_folder(CHILD)): self.blobs.read(key) for key in found}


@pytest.fixture
def world(tmp_path: Path) -> World:
    return World(tmp_path)


def test_the_states_are_the_new_jobs_own_and_doing_it_again_is_harmless(world: World) -> None:
    spec = extension(world.parent, CHILD, 10, "")
    for _ in range(2):
        assert world.submit(spec).spec == spec
    files = world.files()
    assert load_spec(files.pop("spec.json")) == spec
    assert files == {
        "snapshots/0000000-0000000.npz": b"0",
        "snapshots/0000000-0000100.npz": b"100",
        "snapshots/0000000-0000137.npz": b"137",
    }


def test_a_state_that_was_not_planned_is_a_checkpoint_of_the_retry(world: World) -> None:
    world.submit(repetition(world.parent, CHILD))
    assert [name for name in world.files() if "137" in name] == ["checkpoints/0000000-0000137.npz"]


def test_nothing_is_left_of_a_job_that_cannot_be_made(world: World) -> None:
    spec = extension(world.parent, CHILD, 10, "")
    del world.jobs.meshes[MESH_ID]
    with pytest.raises(MeshNotFoundError):
        world.submit(spec)
    assert world.files() == {}
    world.jobs.request_cancel(world.parent.id)
    world.jobs.delete(world.parent.id)
    with pytest.raises(JobGoneError):
        world.submit(spec)
    assert world.files() == {}
