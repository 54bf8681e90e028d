"""What a runner said that did not live to say how it ended."""

from __future__ import annotations

from dataclasses import asdict, replace

from spherify.jobs.model import Progress, Snapshot
from spherify.stores.memory import MemoryJobStore
from tests.jobs.examples import job_spec
from worker.outbox import Outbox

TOLD = Progress(480, 1000, 50.0, 10.4, 9.6)


def test_a_state_that_came_after_the_last_report_tells_how_far_it_was() -> None:
    outbox = Outbox(MemoryJobStore(), job_spec().id, token=1)
    assert outbox.reached(None) is None
    assert outbox.reached(TOLD) == TOLD
    outbox.take_in({"event": "report", "progress": asdict(TOLD), "rows": []})
    assert outbox.reached(Progress(3, 1000)) == TOLD
    for iteration in (470, 500):
        snapshot = Snapshot(iteration, "k", "s", 1, {}, 1.0)
        outbox.take_in({"event": "snapshot", "snapshot": asdict(snapshot)})
    assert outbox.reached(None) == replace(TOLD, iteration=500)
