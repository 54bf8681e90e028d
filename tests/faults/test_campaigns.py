"""Rows 1, 2, 4, 7 and 9 of docs/durability.md: jobs under kills of everything there is."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.faults.campaign import campaign
from tests.faults.ledger import Verdict
from tests.faults.specimens import Specimen

JOBS = 20
LIMIT_S = 110


@pytest.mark.timeout(180)
@pytest.mark.parametrize(
    ("seed", "faults"),
    [
        pytest.param(1, {"kill_worker": 5}, id="workers-killed"),
        pytest.param(2, {"kill_runner": 4, "kill_child": 3}, id="children-and-runners-killed"),
        pytest.param(4, {"kill_broker": 3, "stop_broker": 2}, id="broker-killed-and-stopped"),
    ],
)
def test_every_acknowledged_job_is_done_once_and_right(
    tmp_path: Path, specimens: list[Specimen], seed: int, faults: dict[str, int]
) -> None:
    with campaign(tmp_path, seed) as one:
        assert one.run(specimens, JOBS, faults, limit_s=LIMIT_S) == Verdict()
        assert {hit.fault for hit in one.injectors.hits} == faults.keys()
