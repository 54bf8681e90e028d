"""Row 8 of docs/durability.md: the API is killed between any two steps of a submit."""

from __future__ import annotations

import socket
import sys
from functools import partial
from pathlib import Path

import pytest

from spherify.jobs import layout
from spherify.jobs.model import JobStatus
from spherify.jobs.reconcile import sweep_scratch
from tests.faults.campaign import SHORT, say
from tests.faults.ledger import Ledger, Verdict, judge
from tests.faults.logs import Logs
from tests.faults.specimens import Specimen, specimen
from tests.stack import started_stack, wait_for

STEPS = (
    "before:blobs.adopt",
    "after:blobs.adopt",
    "before:meshes.add",
    "after:meshes.add",
    "before:jobs.add",
    "after:jobs.add",
    "before:queue.send",
    "after:queue.send",
    "before:repeats.answered",
    "after:repeats.answered",
)


def kill_at_every_step(folder: Path, rounds: int) -> dict[str, int]:
    """Submit as often as there are deaths to die, under a key each; returns how it went."""
    base = specimen(folder, "stone", 60, 20, 10)
    points = [step for _ in range(rounds) for step in STEPS]
    with started_stack(folder, workers=1, api=False, environment=SHORT) as stack:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        command = [sys.executable, "-m", "tests.faults.dying_api", str(port), *points]
        process = stack._start("api", command)
        ledger = Ledger(f"http://127.0.0.1:{port}")

        def up() -> bool:
            assert process.poll() is None
            with socket.socket() as probe:
                return probe.connect_ex(("127.0.0.1", port)) == 0

        wait_for(up)
        insistent = []
        for number, _ in enumerate(points):
            # a file of its own, so that every step is taken; the comment changes its hash and nothing else
            content = base.content.replace(b"\nelement vertex", b"\ncomment %d\nelement vertex" % number, 1)
            wanted = Specimen(base.name, content, base.fields, base.expected)
            ledger.http.headers["Connection"] = "close"
            if ledger.submit(wanted, f"{number}") is None and number % 2:
                insistent.append(partial(ledger.submit, wanted, f"{number}"))
        for ask_again in insistent:  # every other client
            wait_for(ask_again, limit_s=60)
        recorded = {path.name for path in (stack.stores.blobs.root / "jobs").iterdir()}

        def all_done() -> bool:
            return all(stack.stores.jobs.get(job_id).status.done for job_id in ledger.acknowledged)

        wait_for(all_done, limit_s=120)
        assert judge(ledger, Logs(folder)) == Verdict()
        known = {job.id for job in stack.stores.jobs.find(limit=10_000).items}
        assert known <= recorded, "no record without its spec"

        def status(job_id: str) -> JobStatus:
            return stack.stores.jobs.get(job_id).status

        for job_id in known - ledger.acknowledged.keys():  # nobody was told, and yet it is whole
            wait_for(lambda: all(status(job_id).done for job_id in known), limit_s=60)
            assert status(job_id) is JobStatus.SUCCESSFUL
        scratch = stack.stores.blobs.scratch()
        left = len(list(scratch.iterdir()))
        sweep_scratch(scratch.iterdir(), older_than_s=0)
        assert list(scratch.iterdir()) == []
        assert all(stack.stores.blobs.stat(layout.spec(job_id)) for job_id in known)
        ledger.http.close()
        return {
            "deaths": len(points),
            "acknowledged": len(ledger.acknowledged),
            "known": len(known),
            "left": left,
        }


@pytest.mark.drill
@pytest.mark.timeout(3600)
def test_thirty_deaths_at_every_step(tmp_path: Path) -> None:
    figures = kill_at_every_step(tmp_path, rounds=30)
    say(f"dying API: {figures}")
    assert figures["acknowledged"] >= 30 * len(STEPS) // 2


def test_whatever_step_the_api_dies_at_no_promise_is_broken(tmp_path: Path) -> None:
    figures = kill_at_every_step(tmp_path, rounds=1)
    assert figures["acknowledged"] >= len(STEPS) // 2
