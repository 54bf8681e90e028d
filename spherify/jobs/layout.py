"""Where the files of meshes and jobs lie in the blob store.

    meshes/{mesh}/original.{ext}  mesh.npz  record.json
    jobs/{job}/spec.json                                   before the record
               withdrawn.json                              the record could not be written, and nobody was told of a job
               attempts/{token}.json                       before an attempt begins; swept at the end
               cancel.json                                 before a cancel is answered
               snapshots/{token}-{iteration}.npz           before the snapshot is known; public
               checkpoints/{token}-{iteration}.npz         between snapshots; swept at the end
               result.json                                 before the end is known; the first one wins
               result-again.json                           the same, where result.json is damaged
    tombstones/{job}                                       before the record of a deleted job is removed; 30 days;
                                                           holds the Idempotency-Key it was asked for under

Tokens and iterations are padded with zeros, for people; programs compare `numbers`, because they may grow beyond that.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from spherify.jobs.ports import BlobStat

_NUMBERED: Final = re.compile(r"\d{7,16}(-\d{7,16}\.npz|\.json)")
TOMBSTONE_S: Final = 30 * 24 * 3600  # so long it is known that a job was deleted


def mesh_folder(mesh_id: str) -> str:
    """Return the prefix of everything of a mesh."""
    return f"meshes/{mesh_id}/"


def mesh_arrays(mesh_id: str) -> str:
    """Return the key of the canonical mesh: the arrays ``vertices`` and ``faces``."""
    return f"meshes/{mesh_id}/mesh.npz"


def mesh_original(mesh_id: str, extension: str) -> str:
    """Return the key of the bytes as they were uploaded."""
    return f"meshes/{mesh_id}/original.{extension}"


def mesh_record(mesh_id: str) -> str:
    """Return the key of the mesh's record."""
    return f"meshes/{mesh_id}/record.json"


def meshes() -> str:
    """Return the prefix of all meshes."""
    return "meshes/"


def jobs() -> str:
    """Return the prefix of all jobs."""
    return "jobs/"


def tombstones() -> str:
    """Return the prefix of the marks of deleted jobs."""
    return "tombstones/"


def tombstone(job_id: str) -> str:
    """Return the key that says that a job was deleted."""
    return f"tombstones/{job_id}"


def job_folder(job_id: str) -> str:
    """Return the prefix of everything of a job."""
    return f"jobs/{job_id}/"


def spec(job_id: str) -> str:
    """Return the key of what was asked."""
    return f"jobs/{job_id}/spec.json"


def withdrawn(job_id: str) -> str:
    """Return the key that says that a spec never became a job."""
    return f"jobs/{job_id}/withdrawn.json"


def cancel(job_id: str) -> str:
    """Return the key that says that a job was to be cancelled."""
    return f"jobs/{job_id}/cancel.json"


def attempts(job_id: str) -> str:
    """Return the prefix of what is kept of a job's attempts."""
    return f"jobs/{job_id}/attempts/"


def account(job_id: str, token: int) -> str:
    """Return the key of what had been spent when an attempt began."""
    return f"{attempts(job_id)}{token:07d}.json"


def token_of(key: str) -> int:
    """Return the token of a key that `account` made."""
    return int(key.rpartition("/")[2].removesuffix(".json"))


def result(job_id: str) -> str:
    """Return the key of how it ended."""
    return f"jobs/{job_id}/result.json"


def result_again(job_id: str) -> str:
    """Return the key of how it ended where `result` is damaged."""
    return f"jobs/{job_id}/result-again.json"


def snapshots(job_id: str) -> str:
    """Return the prefix of a job's snapshots."""
    return f"jobs/{job_id}/snapshots/"


def is_snapshot(key: str) -> bool:
    """Return whether a key lies below `snapshots`."""
    return key.split("/")[2:3] == ["snapshots"]


def job_of(key: str) -> str:
    """Return whose a key below the folder of a job is."""
    return key.split("/")[1]


def checkpoints(job_id: str) -> str:
    """Return the prefix of a job's checkpoints between snapshots."""
    return f"jobs/{job_id}/checkpoints/"


def numbered(prefix: str, token: int, iteration: int) -> str:
    """Return the key of one attempt's state at one iteration."""
    return f"{prefix}{token:07d}-{iteration:07d}.npz"


def numbers(key: str) -> tuple[int, int]:
    """Return token and iteration of a key that `numbered` made."""
    token, _, iteration = key.rpartition("/")[2].removesuffix(".npz").partition("-")
    return int(token), int(iteration)


def numbered_only(stats: Iterable[BlobStat]) -> Iterator[BlobStat]:
    """Yield those whose keys `numbered` or `account` made, and not what anybody else has put beside them."""
    return (stat for stat in stats if _NUMBERED.fullmatch(stat.key.rpartition("/")[2]))
