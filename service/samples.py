"""The sample shapes, built by the service, taken in like any upload."""

from __future__ import annotations

from typing import Final

from anyio import to_thread
from pydantic import Field

from service.context import Services
from service.schemas import Answer, Links
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
    file = Scratch(services.stores.blobs.scratch(), services.settings.min_free_bytes)
    try:
        file.feed(data)
        upload = await file.finish(f"{name}.{FORMAT}")
        return await services.intake.accept(upload, ())
    finally:
        file.discard()
