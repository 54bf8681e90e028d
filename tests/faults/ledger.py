"""What a client was promised, and whether it was kept: every acknowledged submit, and the check of each."""

from __future__ import annotations

import hashlib
from collections import Counter
from dataclasses import dataclass, field

import httpx

from tests.faults.logs import Logs
from tests.faults.specimens import Specimen
from tests.processes import working_in
from tests.stack import Stack, wait_for


@dataclass
class Ledger:
    """A client that keeps books.

    Attributes:
        acknowledged: job id → what was sent, for every 201.
        unanswered: sent, and answered with 503 or not at all: it may or may not have been recorded.

    """

    url: str
    acknowledged: dict[str, Specimen] = field(default_factory=dict)
    unanswered: int = 0

    def __post_init__(self) -> None:
        self.http = httpx.Client(base_url=self.url, timeout=30, trust_env=False)

    def submit(self, specimen: Specimen, key: str) -> str | None:
        """Submit once under an Idempotency-Key; the job's id, or None: try again, with the same key."""
        try:
            answer = self.http.post(
                "/v1/jobs",
                files={"file": (specimen.name, specimen.content)},
                data=specimen.fields,
                headers={"Idempotency-Key": key},
            )
        except httpx.TransportError:  # the service is being killed
            self.unanswered += 1
            return None
        if answer.status_code in {httpx.codes.SERVICE_UNAVAILABLE, httpx.codes.CONFLICT}:  # or still at it
            assert "retry-after" in answer.headers
            self.unanswered += 1
            return None
        assert answer.status_code == httpx.codes.CREATED, answer.text
        job_id = str(answer.json()["id"])
        self.acknowledged[job_id] = specimen
        return job_id


@dataclass(frozen=True)
class Verdict:
    """What is wrong; all of it is empty after a campaign that was survived.

    Attributes:
        lost: acknowledged, and unknown to the service.
        stuck: acknowledged, and not done although nothing is wrong any more.
        failed: ended otherwise than by success, with the reason.
        wrong: snapshots whose bytes differ from those of a local run, or are missing.
        double: ended by more than one attempt.

    """

    lost: tuple[str, ...] = ()
    stuck: tuple[str, ...] = ()
    failed: tuple[str, ...] = ()
    wrong: tuple[str, ...] = ()
    double: tuple[str, ...] = ()


def judge(ledger: Ledger, logs: Logs) -> Verdict:
    """Ask the service for everything that was promised."""
    found: dict[str, list[str]] = {name: [] for name in ("lost", "stuck", "failed", "wrong")}
    for job_id, specimen in ledger.acknowledged.items():
        answer = ledger.http.get(f"/v1/jobs/{job_id}")
        if answer.status_code != httpx.codes.OK:
            found["lost"].append(f"{job_id}: {answer.status_code}")
            continue
        job = answer.json()
        if not job["done"]:
            found["stuck"].append(f"{job_id}: {job['status']}")
        elif job["status"] != "successful":
            found["failed"].append(f"{job_id}: {job['status']}, {job['error']}")
        else:
            found["wrong"] += [f"{job_id}: {which}" for which in _wrong(ledger.http, job_id, specimen)]
    ends = Counter(logs.own_ends())
    double = tuple(job_id for job_id, times in ends.items() if times > 1)
    return Verdict(double=double, **{name: tuple(jobs) for name, jobs in found.items()})


def assert_no_zombies(stack: Stack) -> None:
    """Stop the stack, and see that nothing of it is left."""
    stack.stop()
    wait_for(lambda: not working_in(stack.data_dir), what=f"the end of {working_in(stack.data_dir)}")


def _wrong(http: httpx.Client, job_id: str, specimen: Specimen) -> list[str]:
    wrong = []
    for which, expected in specimen.expected.items():
        answer = http.get(f"/v1/jobs/{job_id}/snapshots/{which}.ply")
        if answer.status_code != httpx.codes.OK or hashlib.sha256(answer.content).hexdigest() != expected:
            wrong.append(f"{which}, {answer.status_code}")
    return wrong
