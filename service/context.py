"""What a request works with: built once by `service.app`, handed to routes by FastAPI."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Final, Protocol

from anyio import CapacityLimiter
from fastapi import Depends
from starlette.requests import Request

from service.cache import FileCache
from service.intake import Intake
from service.job_answers import JobDocuments
from service.reading import JobReader
from service.watch import Watch
from spherify.jobs.ports import BlobStore, JobQueue, JobStore, MeshStore
from spherify.jobs.repeats import RepeatStore
from spherify.settings import Settings

CONVERSIONS: Final = 4  # at once: the text of a large mesh takes a few hundred megabytes
VIEWS: Final = 4  # at once, beside those: they are small, and a page waits for them


class Stores(Protocol):
    """What `spherify.stores.connect.open_stores` returns, and what a test may put in its place."""

    @property
    def jobs(self) -> JobStore:
        """Records of jobs."""

    @property
    def meshes(self) -> MeshStore:
        """Records of meshes."""

    @property
    def blobs(self) -> BlobStore:
        """Files."""

    @property
    def queue(self) -> JobQueue:
        """The way to the workers."""

    @property
    def repeats(self) -> RepeatStore:
        """Requests that may be sent twice."""

    def close(self) -> None:
        """Close the connections."""


@dataclass(frozen=True, slots=True)
class Services:
    """Everything a route may use."""

    settings: Settings
    stores: Stores
    intake: Intake
    cache: FileCache
    watch: Watch
    documents: JobDocuments
    reader: JobReader
    conversions: CapacityLimiter = field(default_factory=lambda: CapacityLimiter(CONVERSIONS))
    views: CapacityLimiter = field(default_factory=lambda: CapacityLimiter(VIEWS))

    @classmethod
    def of(cls, settings: Settings, stores: Stores) -> Services:
        """Build the rest from settings and stores."""
        cache = FileCache(settings.data_dir / "cache", settings.cache_bytes, settings.min_free_bytes)
        documents = JobDocuments()
        return cls(
            settings,
            stores,
            Intake(stores.meshes, stores.blobs, settings),
            cache,
            Watch(stores.jobs),
            documents,
            JobReader(stores.jobs, documents),
        )


async def _services(request: Request) -> Services:
    services: Services = request.app.state.services
    return services


Context = Annotated[Services, Depends(_services)]
