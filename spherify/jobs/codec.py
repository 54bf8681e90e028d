"""The JSON forms of the frozen records: what stands in ``spec.json``, ``result.json`` and in the job store.

Written with sorted keys and without spaces, so that equal records are equal bytes.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from spherify.jobs.model import (
    JobError,
    JobSpec,
    JobStatus,
    MeshRecord,
    Outcome,
    Progress,
    RequestKey,
    Snapshot,
)


def dumps(value: Any) -> str:  # noqa: ANN401 (whatever JSON holds)
    """Return JSON, the same for equal values."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False)


def dump_record(record: JobSpec | Snapshot | Progress | Outcome | JobError | MeshRecord) -> str:
    """Return the JSON of one record."""
    return dumps(asdict(record))


def load_spec(text: str | bytes) -> JobSpec:
    """Read what `dump_record` wrote of a spec."""
    data: dict[str, Any] = dict(json.loads(text))
    request = data.get("request")  # it is younger than the rest
    return JobSpec(
        **{
            **data,
            "tags": tuple(data["tags"]),
            "snapshots_requested": tuple(data["snapshots_requested"]),
            "request": None if request is None else RequestKey(**request),
        }
    )


def dump_request(request: RequestKey | None) -> bytes:
    """Return what is kept of a deleted job: the key that it was asked for under, nothing if there was none."""
    return b"" if request is None else dumps(asdict(request)).encode()


def load_request(text: bytes) -> RequestKey | None:
    """Read what `dump_request` wrote."""
    return RequestKey(**json.loads(text)) if text else None


def load_snapshot(data: str | bytes | Mapping[str, Any]) -> Snapshot:
    """Read a snapshot from its JSON, or from the object in it."""
    return Snapshot(**(json.loads(data) if isinstance(data, str | bytes) else data))


def load_progress(data: str | bytes | Mapping[str, Any]) -> Progress:
    """Read progress from its JSON, or from the object in it."""
    return Progress(**(json.loads(data) if isinstance(data, str | bytes) else data))


def load_error(text: str | bytes) -> JobError:
    """Read what `dump_record` wrote of an error."""
    return JobError(**json.loads(text))


def load_outcome(data: Mapping[str, Any]) -> Outcome:
    """Read an outcome from the object in its JSON."""
    error = data["error"]
    return Outcome(
        **{**data, "status": JobStatus(data["status"]), "error": None if error is None else JobError(**error)}
    )


def load_mesh_record(text: str | bytes) -> MeshRecord:
    """Read what `dump_record` wrote of a mesh."""
    data = json.loads(text)
    return MeshRecord(**{**data, "allow": tuple(data["allow"])})
