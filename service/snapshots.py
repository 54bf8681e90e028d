"""Which state of a job an address means, and which representation of it a client wants."""

from __future__ import annotations

import math
import re
from typing import Final

from service.delivery import IMMUTABLE, REVALIDATE
from service.problems import ProblemError
from spherify.formats import FORMATS_OUT, media_type
from spherify.jobs.model import Job, JobStatus, Snapshot

NAMES: Final = ("initial", "latest", "best", "final")
_JSON: Final = "application/json"
_BY_TYPE: Final = {media_type(form): form for form in FORMATS_OUT if media_type(form) != "text/plain"}


def retry_after_s(job: Job) -> int:
    """Return when it is worth asking about an unfinished job again: a twentieth of what is left, 1 to 10 s."""
    if job.status is JobStatus.ACCEPTED:
        return 2
    eta_s = job.progress.eta_s if job.progress is not None else None
    return 1 if eta_s is None else min(max(math.ceil(eta_s / 20), 1), 10)


def best_iteration(job: Job) -> int | None:
    """Return the kept state of the highest sphericity; while a job runs, of those kept so far."""
    if job.best_iteration is not None:
        return job.best_iteration
    figures = {snapshot.iteration: snapshot.metrics.get("sphericity", 0.0) for snapshot in job.snapshots}
    return max(figures, key=lambda iteration: figures[iteration], default=None)


def find(job: Job, which: str) -> tuple[Snapshot, str]:
    """Return the snapshot that a name or number means, and its Cache-Control.

    Numbers never change their meaning; the names do while the job runs.

    Raises:
        ProblemError: result-not-ready, not-found.

    """
    kept = {snapshot.iteration: snapshot for snapshot in job.snapshots}
    if re.fullmatch(r"0|[1-9]\d{0,11}", which):
        wanted: int | None = int(which)
    elif which in NAMES:
        wanted = {
            "initial": 0,
            "latest": max(kept, default=None),
            "best": best_iteration(job),
            "final": job.result_iteration if job.status.done else None,
        }[which]
    else:
        raise ProblemError(
            "not-found", f"{which[:40]!r} is no snapshot: name an iteration, or one of {', '.join(NAMES)}"
        )
    if wanted in kept:
        fixed = which not in NAMES or which == "initial" or job.status.done
        return kept[wanted], IMMUTABLE if fixed else REVALIDATE
    raise _missing(job, which, list(kept))


def negotiate(accept: str | None) -> str | None:
    """Return the format that an Accept header wants, None for JSON; raises `not-acceptable`."""
    ranges = [_media_range(part) for part in (accept or "*/*").split(",") if part.strip()]
    offers = (_JSON, *_BY_TYPE)
    quality = {offer: _quality(offer, ranges) for offer in offers}
    best = max(offers, key=lambda offer: quality[offer])  # the first of equals: JSON
    if quality[best] <= 0:
        raise ProblemError("not-acceptable", f"one of these can be had: {', '.join(offers)}")
    return _BY_TYPE.get(best)


def _missing(job: Job, which: str, kept: list[int]) -> ProblemError:
    listed = ", ".join(map(str, kept)) or "none"
    coming = which in NAMES or int(which) in job.spec.snapshots_requested
    if not job.status.done and coming:
        at = job.progress.iteration if job.progress is not None else 0
        return ProblemError(
            "result-not-ready",
            f"{job.id} is {job.status} at iteration {at} and has not reached {which}; kept so far: {listed}",
            headers={"Retry-After": str(retry_after_s(job))},
        )
    ended = f"the job ended as {job.status}" if job.status.done else "it was not asked for"
    return ProblemError("not-found", f"{job.id} has no snapshot {which}: {ended}; kept: {listed}")


def _media_range(text: str) -> tuple[str, float]:
    kind, *options = (part.strip().lower() for part in text.split(";"))
    for option in options:
        if match := re.fullmatch(r"q\s*=\s*([01](?:\.\d{0,3})?)", option):
            return kind, float(match[1])
    return kind, 1.0


def _quality(offer: str, ranges: list[tuple[str, float]]) -> float:
    """Return the quality of the most specific range that fits (RFC 9110, 12.5.1)."""
    for fitting in (offer, f"{offer.split('/', maxsplit=1)[0]}/*", "*/*"):
        found = [quality for kind, quality in ranges if kind == fitting]
        if found:
            return max(found)
    return 0.0
