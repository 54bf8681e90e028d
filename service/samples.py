"""Meshes that are made here, sample shapes and states of jobs, taken in like any upload."""

from __future__ import annotations

from collections.abc import Collection
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
    data = await to_thread.run_sync(
        lambda: write_mesh(SAMPLES[name].build(vertices), FORMAT), limiter=services.conversions
    )
    return await _take_in(services, data, f"{name}.{FORMAT}", ())


async def take_in_state(services: Services, address: str) -> MeshRecord:
    """Return the mesh that a kept state is, of an address `job/which`: same state, same mesh.

    Raises:
        ProblemError, JobNotFoundError, JobGoneError, StorageFullError, StoreUnavailableError: as of every state, and
            of every upload.

    """
    job_id, _, which = address.partition("/")
    stores = services.stores

    def written() -> tuple[bytes, str, MeshRecord]:
        job = stores.jobs.get(job_id)
        snapshot, _ = find(job, which)
        data = write_mesh(State(job.spec.mesh_id, snapshot).load(stores.blobs)[1], FORMAT)
        name = file_name(job.spec.name, f"_it{snapshot.iteration:05d}.{FORMAT}")
        return data, name, stores.meshes.get(job.spec.mesh_id)

    data, name, origin = await to_thread.run_sync(written, limiter=services.conversions)
    return (await _take_in(services, data, name, origin.allow))[0]


async def _take_in(
    services: Services, data: bytes, name: str, allow: Collection[str]
) -> tuple[MeshRecord, bool]:
    file = Scratch(services.stores.blobs.scratch(), services.settings.min_free_bytes)
    try:
        file.feed(data)
        upload = await file.finish(name)
        return await services.intake.accept(upload, allow)
    finally:
        file.discard()
