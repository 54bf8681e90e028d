"""What a runner says when it cannot do what it was ordered, in this process."""

from __future__ import annotations

import errno
import io
import json
import resource
import sys
from pathlib import Path
from typing import Any

import pytest

from spherify.jobs import layout
from spherify.jobs.codec import dump_record
from spherify.jobs.ids import new_job_id
from spherify.stores.arrays import dump_arrays
from spherify.stores.blobs import FolderBlobStore
from tests.jobs.examples import ENDLESS, job_spec, stone
from tests.s3 import environment_for
from worker import runner
from worker.orders import Order
from worker.resume import Resumption, find_resumption


def test_files_that_cannot_be_reached_are_no_fault_of_the_job(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("obstore")
    for name, value in environment_for(port=1).items():  # nobody listens there
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(runner, "_PATIENCE_S", 0.2)
    order = _order(new_job_id()[0], tmp_path, blobs="s3://bucket")

    def said() -> list[Any]:
        pipe = io.BytesIO()
        runner.work(order, pipe, [])
        return [json.loads(line) for line in pipe.getvalue().splitlines()]

    assert said() == [{"event": "handed-on"}]
    assert f"{order.job_id}: handed on" in capfd.readouterr().err

    class Full(io.StringIO):
        def write(self, _: str) -> int:
            raise OSError(errno.ENOSPC, "full")

    monkeypatch.setattr(sys, "stderr", Full())
    assert said() == [{"event": "handed-on"}], "nor is a full disk of the log"


def test_the_reading_of_states_counts_as_computing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Else the supervisor, whose clock runs, ends the runner before it has kept the state it is at."""
    blobs = FolderBlobStore(tmp_path)
    spec = job_spec(**ENDLESS, snapshots="1")
    arrays = {"vertices": stone().vertices, "faces": stone().faces}
    blobs.create(layout.mesh_arrays(spec.mesh_id), dump_arrays(arrays))
    blobs.create(layout.spec(spec.id), dump_record(spec).encode())
    now = [0.0]

    def slow(*args: Any) -> Resumption:
        now[0] += 61.0
        return find_resumption(*args)

    monkeypatch.setattr(runner, "monotonic", lambda: now[0])
    monkeypatch.setattr(runner, "find_resumption", slow)
    pipe = io.BytesIO()
    runner.work(_order(spec.id, tmp_path, engine="reference"), pipe, [])
    *_, kept, end = map(json.loads, pipe.getvalue().splitlines())
    assert kept["event"] == "snapshot"
    assert (end["event"], end["outcome"]["stop_reason"]) == ("end", "deadline")
    assert end["outcome"]["result_iteration"] == kept["snapshot"]["iteration"]


def _order(job_id: str, data_dir: Path, **changes: Any) -> Order:
    return Order(
        job_id=job_id,
        token=1,
        data_dir=str(data_dir),
        memory_bytes=resource.RLIM_INFINITY,
        deadline_s=60.0,
        limit_s=60.0,
        checkpoint_s=60.0,
        **changes,
    )
