"""From the settings to the adapters."""

from __future__ import annotations

from dataclasses import dataclass

import redis

from spherify.jobs.ports import BlobStore
from spherify.jobs.stock import Stock
from spherify.settings import Settings
from spherify.stores.client import connect
from spherify.stores.files import open_blobs
from spherify.stores.queue import CeleryJobQueue
from spherify.stores.redis_jobs import RedisJobStore
from spherify.stores.redis_meshes import RedisMeshStore
from spherify.stores.repeats import RedisRepeatStore
from spherify.stores.states import find_trail


@dataclass(frozen=True, slots=True)
class Stores:
    """Everything a process stores in or sends through; may be shared by threads."""

    jobs: RedisJobStore
    meshes: RedisMeshStore
    blobs: BlobStore
    queue: CeleryJobQueue
    repeats: RedisRepeatStore
    client: redis.Redis

    @property
    def stock(self) -> Stock:
        """What the reconciler looks through."""
        return Stock(self.jobs, self.meshes, self.blobs, self.queue, self.repeats, find_trail)

    def close(self) -> None:
        """Close the connections; a later use opens new ones."""
        self.queue.close()
        self.client.close()


def open_stores(settings: Settings, *, timeout_s: float = 0.5) -> Stores:
    """Return the adapters that the settings name; nothing is sent before their first use.

    Args:
        settings: address of the server, folder of the files, lease and losses.
        timeout_s: longest wait for an answer of the server.

    """
    client = connect(settings.redis_url, timeout_s=timeout_s)
    return Stores(
        jobs=RedisJobStore(client, lease_s=settings.lease_s, max_losses=settings.max_losses),
        meshes=RedisMeshStore(client),
        blobs=open_blobs(settings.blobs, settings.data_dir / "blobs"),
        queue=CeleryJobQueue(settings.redis_url, timeout_s=timeout_s),
        repeats=RedisRepeatStore(client),
        client=client,
    )
