"""Identifiers of jobs: a prefix and a ULID, so that they sort by time and name their kind."""

from __future__ import annotations

import re
from typing import Final

from ulid import ULID

_ULID: Final = "[0-7][0-9A-HJKMNP-TV-Z]{25}"
JOB_ID: Final = re.compile(f"job_{_ULID}")
MESH_ID: Final = re.compile("mesh_[0-9A-Za-z]{26}")


def new_job_id() -> tuple[str, float]:
    """Return a new identifier and the seconds since the epoch that it holds, its time of creation."""
    ulid = ULID()
    return f"job_{ulid}", ulid.timestamp


def time_of(job_id: str) -> float:
    """Return when an identifier was made, in seconds since the epoch."""
    return ULID.from_str(job_id.removeprefix("job_")).timestamp


def job_id_at(seconds: float) -> str:
    """Return an identifier of a given time of creation, in seconds since the epoch."""
    return f"job_{ULID.from_timestamp(float(seconds))}"


def earliest_job_id(seconds: float) -> str:
    """Return what sorts before every identifier made at or after a time, in seconds since the epoch."""
    return job_id_at(seconds)[: len("job_") + 10]  # the first ten digits are the time


def is_job_id(text: str) -> bool:
    """Whether this has the form of a job's identifier."""
    return JOB_ID.fullmatch(text) is not None
