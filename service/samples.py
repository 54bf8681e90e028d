"""Meshes that are made here, sample shapes and states of jobs, taken in like any upload."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Final

from anyio import to_thread
from pydantic import Field

from service.arrays import State
from service.context import Services
from service.delivery import file_name
from service.schemas import Answer, Links
from service.snapshots import find
from service.uploads import Scratch
from spherify.formats import write_mesh
from spherify.geometry.samples import SAMPLES
from spherify.jobs.model import MeshRecord

DEFAULT_VERTICES: Final = 3000
MAX_VERTICES: Final = 50_000
FORMAT: Final = "ply"


class SampleOut(Answer):
    """A shape with a name."""

    name: str = Field(examples=["quadruped"])
    title: str = Field(examples=["A cat-like animal, for the paper's puma"])
    links: Links


class SamplesOut(Answer):
    """All of them."""

    items: list[SampleOut]


def samples_out() -> SamplesOut:
    """Describe the samples."""
    return SamplesOut(
        items=[
            SampleOut(name=it.name, title=it.title, links={"create": f"/v1/samples/{it.name}"})
            for it in SAMPLES.values()
        ]
    )


async def take_in(services: Services, name: str, vertices: int) -> tuple[MeshRecord, bool]:
    """Build a sample and return its mesh, and whether it is new; same name and number, same mesh.

    Raises:
        ProblemError, StorageFullError, StoreUnavailableError: as every upload.

    """
    return await _take_in(
        services, lambda: _Written(write_mesh(SAMPLES[name].build(vertices), FORMAT), f"{name}.{FORMAT}")
    )


async def take_in_state(services: Services, address: str) -> MeshRecord:
    """Return the mesh that a kept state is, of an address `job/which`: same state, same mesh.

    Raises:
        ProblemError, JobNotFoundError, JobGoneError, StorageFullError, StoreUnavailableError: as of every state, and
            of every upload.

    """
    job_id, _, which = address.partition("/")
    stores = services.stores

    def written() -> _Written:
        job = stores.jobs.get(job_id)
        snapshot, _ = find(job, which)
        data = write_mesh(State(job.spec.mesh_id, snapshot).load(stores.blobs)[1], FORMAT)
        name = file_name(job.spec.name, f"_it{snapshot.iteration:05d}.{FORMAT}")
        return _Written(data, name, stores.meshes.get(job.spec.mesh_id).allow)

    return (await _take_in(services, written))[0]


@dataclass(frozen=True, slots=True)
class _Written:
    """The file that a mesh was written to, its name, and the switches to read it with."""

    data: bytes
    name: str
    allow: Collection[str] = ()


async def _take_in(services: Services, write: Callable[[], _Written]) -> tuple[MeshRecord, bool]:
    """Take in what is written in a thread; it waits on the disk, and not in memory, to be read."""
    file = Scratch(services.stores.blobs.scratch(), services.settings.min_free_bytes)

    def fill() -> tuple[str, Collection[str]]:
        written = write()
        file.feed(written.data)
        return written.name, written.allow

    try:
        name, allow = await to_thread.run_sync(fill, limiter=services.conversions)
        upload = await file.finish(name)
        return await services.intake.accept(upload, allow)
    finally:
        file.discard()
