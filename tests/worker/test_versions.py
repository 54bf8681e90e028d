"""What a worker does with the files of an attempt that an earlier version of the program made."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from spherify.geometry import progress
from spherify.geometry.kernels import ENGINES
from spherify.geometry.progress import fingerprint_of
from spherify.jobs import layout
from spherify.jobs.model import JobStatus
from spherify.parameters import stored_parameters
from spherify.stores.arrays import dump_arrays, load_arrays
from tests.jobs.examples import job_spec, stone
from tests.stack import Stack, wait_for
from tests.worker.observation import LONG, check_whole, finished, hashes, submitted, under_way


def make_older(stack: Stack, job_id: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let all states of a job look as if version 3 had made them."""
    config = stored_parameters(job_spec(**LONG).parameters).config()
    present = [fingerprint_of(stone(), config, engine) for engine in ENGINES]
    with monkeypatch.context() as patch:
        patch.setattr(progress, "VERSION", 3)
        former = [fingerprint_of(stone(), config, engine) for engine in ENGINES]
    blobs = stack.stores.blobs
    for folder in (layout.snapshots(job_id), layout.checkpoints(job_id)):
        for stat in blobs.list(folder):
            arrays = load_arrays(blobs.read(stat.key))
            (engine,) = (i for i, known in enumerate(present) if np.array_equal(known, arrays["fingerprint"]))
            Path(blobs.root, stat.key).write_bytes(dump_arrays({**arrays, "fingerprint": former[engine]}))


def tokens(stack: Stack, job_id: str) -> dict[int, int]:
    """Return which attempt made each snapshot."""
    job = stack.stores.jobs.get(job_id)
    return {snapshot.iteration: layout.numbers(snapshot.key)[0] for snapshot in job.snapshots}


def test_states_of_an_earlier_version_are_passed_over_for_the_newest_that_can_be_used(
    stack: Stack, undisturbed: dict[int, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    job_id = submitted(stack, job_spec(**LONG))
    under_way(stack, job_id, 200)
    stack.stop_worker("0")
    make_older(stack, job_id, monkeypatch)
    stack.start_worker("0")
    wait_for(lambda: 2 in tokens(stack, job_id).values(), what="the beginning anew")
    assert 1 not in tokens(stack, job_id).values(), "nothing is served that this run may not come to"
    wait_for(lambda: 200 in tokens(stack, job_id), what="more than the next attempt begins with")
    stack.stop_worker("0")
    told = f"{job_id}: the states of an earlier attempt are passed over"
    assert stack.log("worker-0").read_text().count(told) == 1
    stack.start_worker("0")
    job = finished(stack, job_id)
    check_whole(stack, job)
    assert (job.status, job.attempt, job.losses) == (JobStatus.SUCCESSFUL, 3, 0)
    assert hashes(job) == undisturbed
    assert tokens(stack, job_id)[200] == 2, "the third attempt went on from the second one's states"
