"""What the use cases work on: the twins in memory, and a clock that the test turns."""

from __future__ import annotations

from dataclasses import dataclass

from spherify.jobs.model import JobSpec
from spherify.jobs.stock import Stock
from spherify.jobs.submit import submit
from spherify.stores.memory import MemoryJobStore
from spherify.stores.memory_blobs import MemoryBlobStore
from spherify.stores.memory_meshes import MemoryJobQueue, MemoryMeshStore
from spherify.stores.memory_repeats import MemoryRepeatStore
from spherify.stores.states import find_trail
from tests.jobs.examples import job_spec


@dataclass
class World:
    jobs: MemoryJobStore
    meshes: MemoryMeshStore
    blobs: MemoryBlobStore
    queue: MemoryJobQueue
    repeats: MemoryRepeatStore
    now: list[float]

    @property
    def stock(self) -> Stock:
        return Stock(self.jobs, self.meshes, self.blobs, self.queue, self.repeats, find_trail)


def submitted(stock: Stock, **changes: object) -> JobSpec:
    """Submit a job as the service does."""
    spec = job_spec(**changes)  # type: ignore[arg-type]
    submit(stock.jobs, stock.blobs, stock.queue, spec)
    return spec
