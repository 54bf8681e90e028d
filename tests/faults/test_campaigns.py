"""Rows 1, 2, 4, 6, 7 and 9 of docs/durability.md: jobs under kills of everything there is, a few in each test.

`make drills` has the full numbers.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.faults.campaign import campaign
from tests.faults.ledger import Verdict
from tests.faults.specimens import Specimen

JOBS = 16
LIMIT_S = 200  # on a machine that does much else


@pytest.mark.timeout(300)
@pytest.mark.parametrize(
    ("seed", "faults"),
    [
        pytest.param(1, {"kill_worker": 4}, id="workers-killed"),
        pytest.param(2, {"kill_runner": 4, "kill_child": 3}, id="children-and-runners-killed"),
        pytest.param(4, {"kill_broker": 2, "stop_broker": 1}, id="broker-killed-and-stopped"),
        pytest.param(6, {"freeze_worker": 2, "half_open": 1}, id="frozen-and-half-open"),
        pytest.param(7, {"flush": 2}, id="records-flushed"),
        pytest.param(9, {"stop_worker": 4}, id="workers-restarted"),
    ],
)
def test_every_acknowledged_job_is_done_once_and_right(
    tmp_path: Path, specimens: list[Specimen], seed: int, faults: dict[str, int]
) -> None:
    with campaign(tmp_path, seed, through_proxy="half_open" in faults) as one:
        assert one.run(specimens, JOBS, faults, limit_s=LIMIT_S) == Verdict()
        assert {hit.fault for hit in one.injectors.hits} == faults.keys()
        losses = [one.stack.stores.jobs.get(job_id).losses for job_id in one.ledger.acknowledged]
        if "stop_worker" in faults:
            assert max(losses) == 0, "a worker that is told to stop hands on"
            assert one.logs.count("hand-on") >= 1
        if "freeze_worker" in faults:
            assert one.figures["fenced"] >= 1, "who slept through its lease was told so"
