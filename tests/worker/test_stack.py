"""The started stack itself: the API answers, a worker takes jobs, and nothing stays behind."""

from __future__ import annotations

import json
import signal
import urllib.request
from pathlib import Path

from spherify.jobs.submit import submit
from tests.jobs.examples import job_spec, stone, store_mesh
from tests.stack import started_stack, wait_for


def test_a_job_seen_through_the_api_and_everything_gone_afterwards(tmp_path: Path) -> None:
    with started_stack(tmp_path) as stack:
        store_mesh(stack.stores.meshes, stack.stores.blobs, stone())
        job_id = submit(stack.stores.jobs, stack.stores.blobs, stack.stores.queue, job_spec()).id

        def done() -> bool:
            with urllib.request.urlopen(f"{stack.url}/v1/jobs/{job_id}") as answer:
                return bool(json.load(answer)["status"] == "successful")

        wait_for(done, limit_s=60)
        processes = list(stack._processes)
        assert [process.poll() for process in processes] == [None, None]
    # uvicorn shuts down in good order and then passes the signal on to itself
    assert [process.returncode for process in processes] == [0, -signal.SIGTERM]
    assert not stack.server.alive
