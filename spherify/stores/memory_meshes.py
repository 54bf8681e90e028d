"""The twins of the mesh store and of the queue in memory."""

from __future__ import annotations

from collections.abc import Sequence

from spherify.jobs.errors import MeshInUseError, MeshNotFoundError
from spherify.jobs.model import MeshRecord
from spherify.jobs.ports import Page
from spherify.stores.memory import MemoryJobStore
from spherify.stores.redis_meshes import mesh_cursor


class MemoryMeshStore:
    """Mesh records in a dictionary that the jobs know too; asks the jobs which meshes are in use."""

    def __init__(self, jobs: MemoryJobStore) -> None:
        self._records = jobs.meshes
        self._jobs = jobs

    def add(self, record: MeshRecord) -> bool:
        """Record a mesh whose files are durable; False if it was known already (nothing changes)."""
        new = record.id not in self._records
        self._records.setdefault(record.id, record)
        return new

    def get(self, mesh_id: str) -> MeshRecord:
        """Return one record; raises `MeshNotFoundError`."""
        if mesh_id not in self._records:
            raise MeshNotFoundError(f"there is no mesh {mesh_id}")
        return self._records[mesh_id]

    def find(self, *, limit: int = 50, cursor: str | None = None) -> Page[MeshRecord]:
        """Return a page of meshes, newest first; raises `InvalidCursorError`."""
        before = mesh_cursor(cursor)
        newest = sorted(self._records.values(), key=lambda r: (r.created_at, r.id), reverse=True)
        found = [record for record in newest if (record.created_at, record.id) < before]
        last = found[limit - 1] if len(found) > limit else None
        return Page(tuple(found[:limit]), None if last is None else f"{last.created_at!r}~{last.id}")

    def delete(self, mesh_id: str) -> None:
        """Forget a mesh; raises `MeshInUseError` while any job names it, `MeshNotFoundError`."""
        if self._jobs.find(mesh_id=mesh_id, limit=1).items:
            raise MeshInUseError(f"a job names the mesh {mesh_id}: delete the job first")
        self.get(mesh_id)
        del self._records[mesh_id]

    def unknown(self, mesh_ids: Sequence[str]) -> list[str]:
        """Return those of which there is no record."""
        return [mesh_id for mesh_id in mesh_ids if mesh_id not in self._records]


class MemoryJobQueue:
    """A list of ids; `take` is what a worker would do."""

    def __init__(self) -> None:
        self._ahead: list[str] = []
        self._usual: list[str] = []

    def send(self, job_id: str, *, ahead: bool = False) -> None:
        """Send one id, perhaps ahead of those that have not waited before."""
        (self._ahead if ahead else self._usual).append(job_id)

    def take(self) -> str:
        """Deliver the next id; raises `IndexError` when there is none."""
        return (self._ahead or self._usual).pop(0)

    def pending(self, start: int = 0, count: int = 1000) -> list[str]:
        """Return ids in the queue, the next one last, `count` at most from a place on."""
        return [*self._ahead, *self._usual][::-1][start : start + count]

    def length(self) -> int:
        """Return how many messages wait to be delivered."""
        return len(self._ahead) + len(self._usual)
