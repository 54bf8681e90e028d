"""Row 20 of docs/durability.md: the files in a bucket, whose server fails now and then, and dies."""

from __future__ import annotations

import json
import os
import signal
import time
from pathlib import Path

import httpx
import pytest

from spherify.jobs import layout
from tests.faults.campaign import SHORT, campaign, say
from tests.faults.http_chaos import HttpChaos, now_and_then
from tests.faults.ledger import Ledger, Verdict, judge
from tests.faults.logs import Logs
from tests.faults.specimens import Specimen
from tests.processes import below
from tests.s3 import BUCKET, S3Server, environment_for
from tests.stack import QUICK, started_stack, wait_for

pytestmark = pytest.mark.s3
JOBS = int(os.environ.get("DRILL_STORE_JOBS", "100"))
PATIENT = {**SHORT, "SPHERIFY_LEASE_S": "10"}


def test_jobs_are_done_with_all_files_in_a_bucket(
    tmp_path: Path, s3_url: str, specimens: list[Specimen]
) -> None:
    """API, worker and runner share nothing but the bucket and the records; also once a pool process is made anew."""
    environment = {**QUICK, "SPHERIFY_BLOBS": s3_url}
    with started_stack(tmp_path, workers=0, environment=environment) as stack:
        worker = stack.start_worker("far", environment={"SPHERIFY_DATA_DIR": str(tmp_path / "elsewhere")})
        ledger = Ledger(stack.url)
        assert ledger.http.get("/readyz").json()["checks"]["files"] == "ok"
        jobs = stack.stores.jobs
        for round_, some in enumerate((specimens[:2], specimens[2:])):
            for number, specimen in enumerate(some):
                assert ledger.submit(specimen, f"{round_}-{number}")
            wait_for(lambda: all(jobs.get(i).status.done for i in ledger.acknowledged), limit_s=60)
            if round_ == 0:
                pool = [seen for seen in below(worker.pid, "-m worker") if seen.parent == worker.pid]
                assert len(pool) == 1
                os.kill(
                    pool[0].pid, signal.SIGKILL
                )  # the next one is forked from a process that has run for long
        assert judge(ledger, Logs(tmp_path)) == Verdict()

        job = next(iter(ledger.acknowledged))
        mesh = ledger.http.get(f"/v1/jobs/{job}").json()["mesh_id"]
        part = ledger.http.get(f"/v1/meshes/{mesh}/content", headers={"Range": "bytes=3-9"})
        assert (part.status_code, part.content) == (206, ledger.acknowledged[job].content[3:10])
        longer = ledger.http.post(f"/v1/jobs/{job}/extend", json={"iterations": 5}).json()["id"]
        wait_for(lambda: jobs.get(longer).status.done)
        assert jobs.get(longer).status == "successful"
        assert ledger.http.delete(f"/v1/jobs/{longer}").status_code == httpx.codes.NO_CONTENT
        assert list(stack.stores.blobs.list(f"jobs/{longer}")) == []
        assert not [path for path in tmp_path.rglob("*.npz") if "cache" not in path.parts]
        ledger.http.close()


def test_a_job_waits_for_files_that_cannot_be_reached(
    tmp_path: Path, specimens: list[Specimen], monkeypatch: pytest.MonkeyPatch
) -> None:
    with S3Server(tmp_path / "s3") as server:
        for name, value in server.environment.items():
            monkeypatch.setenv(name, value)
        environment = {**QUICK, "SPHERIFY_LEASE_S": "30", "SPHERIFY_BLOBS": f"s3://{BUCKET}/waits"}
        with started_stack(tmp_path / "stack", workers=0, environment=environment) as stack:
            ledger, logs = Ledger(stack.url), Logs(tmp_path / "stack")
            job = ledger.submit(specimens[0], "early")
            assert job is not None
            server.stop()
            stack.start_worker("patient")
            ready = ledger.http.get("/readyz")
            assert ready.status_code == httpx.codes.SERVICE_UNAVAILABLE
            assert ledger.submit(specimens[1], "late") is None  # 503, and when to come back
            wait_for(lambda: logs.count("put-off"), limit_s=60)
            assert stack.stores.jobs.get(job).status in {"accepted", "running"}
            server.start()
            wait_for(lambda: ledger.submit(specimens[1], "late"), limit_s=30)
            wait_for(lambda: all(stack.stores.jobs.get(i).status.done for i in ledger.acknowledged))
            assert judge(ledger, logs) == Verdict()
            assert [stack.stores.jobs.get(i).losses for i in ledger.acknowledged] == [0, 0]
            ledger.http.close()


@pytest.mark.drill
@pytest.mark.timeout(3600)
def test_a_store_that_fails_now_and_then_and_dies(
    tmp_path: Path, specimens: list[Specimen], monkeypatch: pytest.MonkeyPatch
) -> None:
    """One call in ten is refused, lost, cut off or never answered, and the server is killed five times."""
    with S3Server(tmp_path / "s3") as server, HttpChaos(server.port) as proxy:
        for name, value in server.environment.items():  # the tests themselves look past the proxy
            monkeypatch.setenv(name, value)
        url = f"s3://{BUCKET}/drill"
        through = {**PATIENT, **environment_for(proxy.port), "SPHERIFY_BLOBS": url}
        with campaign(tmp_path / "stack", seed=20, environment=through) as one:
            kills: list[float] = []

            def kill_server() -> bool:
                server.stop()
                kills.append(time.monotonic())
                server.start()
                return True

            monkeypatch.setattr(one.injectors, "_kill_store", kill_server, raising=False)
            proxy.plan = now_and_then(20, 0.1)
            faults = {"kill_store": 5, "kill_worker": 3, "kill_runner": 3}
            one.run(specimens, JOBS, faults, limit_s=3000)
            proxy.plan = lambda _method, _path: None
            assert judge(one.ledger, one.logs) == Verdict()  # in peace: 503 is an answer, too, while it fails
            blobs = one.stack.stores.blobs
            files = [stat.key for stat in blobs.list("jobs")]
            results = [key for key in files if key.endswith("/result.json")]
            assert len(results) == JOBS
            assert [key for key in files if key == layout.result_again(key.split("/")[1])] == []
            tokens = {key.split("/")[1]: json.loads(blobs.read(key))["token"] for key in results}
            assert tokens.keys() == one.ledger.acknowledged.keys()
            say(
                f"object store: {proxy.requests} requests, {sum(proxy.hits.values())} failed, {len(kills)} kills"
            )
            assert sum(proxy.hits.values()) > 0.07 * proxy.requests
