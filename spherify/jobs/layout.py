"""Where the files of meshes and jobs lie in the blob store.

    meshes/{mesh}/original.{ext}  mesh.npz  record.json
    jobs/{job}/spec.json                                   before the record
               snapshots/{token}-{iteration}.npz           before the snapshot is known; public
               checkpoints/{token}-{iteration}.npz         between snapshots; swept at the end
               result.json                                 before the end is known; the first one wins

Tokens and iterations are padded with zeros, so that names sort as numbers do.
"""

from __future__ import annotations


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


def job_folder(job_id: str) -> str:
    """Return the prefix of everything of a job."""
    return f"jobs/{job_id}/"


def spec(job_id: str) -> str:
    """Return the key of what was asked."""
    return f"jobs/{job_id}/spec.json"


def result(job_id: str) -> str:
    """Return the key of how it ended."""
    return f"jobs/{job_id}/result.json"


def snapshots(job_id: str) -> str:
    """Return the prefix of a job's snapshots."""
    return f"jobs/{job_id}/snapshots/"


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
