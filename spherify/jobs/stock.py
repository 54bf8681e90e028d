"""Everything that is stored, for whoever compares one part of it with another."""

from __future__ import annotations

from dataclasses import dataclass

from spherify.jobs.ports import BlobStore, JobQueue, JobStore, MeshStore, TrailFinder
from spherify.jobs.repeats import RepeatStore


@dataclass(frozen=True, slots=True)
class Stock:
    """Everything that is stored, and the way to the workers."""

    jobs: JobStore
    meshes: MeshStore
    blobs: BlobStore
    queue: JobQueue
    repeats: RepeatStore
    find_trail: TrailFinder
