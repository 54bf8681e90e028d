"""What a runner says when it cannot do what it was ordered, in this process."""

from __future__ import annotations

import io
import json
import resource
from pathlib import Path

import pytest

from spherify.jobs.ids import new_job_id
from tests.s3 import environment_for
from worker import runner
from worker.orders import Order


def test_files_that_cannot_be_reached_are_no_fault_of_the_job(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("obstore")
    for name, value in environment_for(port=1).items():  # nobody listens there
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(runner, "_PATIENCE_S", 0.2)
    pipe = io.BytesIO()
    order = Order(
        job_id=new_job_id()[0],
        token=1,
        data_dir=str(tmp_path),
        memory_bytes=resource.RLIM_INFINITY,
        deadline_s=60.0,
        checkpoint_s=60.0,
        blobs="s3://bucket",
    )
    runner.work(order, pipe, [])
    assert json.loads(pipe.getvalue()) == {"event": "handed-on"}
    assert f"{order.job_id}: handed on" in capfd.readouterr().err
