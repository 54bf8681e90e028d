"""The records of meshes in a Redis-protocol server."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import redis

from spherify.jobs.codec import dump_record, load_mesh_record
from spherify.jobs.errors import InvalidCursorError, MeshInUseError, MeshNotFoundError, StoreUnavailableError
from spherify.jobs.model import MeshRecord
from spherify.jobs.ports import Page
from spherify.stores import keys
from spherify.stores.client import Scripts, reachable
from spherify.stores.epoch import REBUILDING, complete_throughout

_CHUNK: Final = 200


class RedisMeshStore:
    """A `spherify.jobs.ports.MeshStore`; the jobs' own index tells which meshes are in use."""

    def __init__(self, client: redis.Redis) -> None:
        self._client = client
        self._scripts = Scripts(client)

    def add(self, record: MeshRecord) -> bool:
        """Record a mesh whose files are durable; False if it was known already (nothing changes)."""
        args = [record.id, dump_record(record), repr(record.created_at)]
        return bool(self._scripts("add_mesh", [keys.mesh(record.id), keys.MESHES], args, common=False))

    def get(self, mesh_id: str) -> MeshRecord:
        """Return one record; raises `MeshNotFoundError`."""
        with reachable():
            text, complete = self._client.mget(keys.mesh(mesh_id), keys.EPOCH)
        if text is None and complete is None:
            raise StoreUnavailableError(REBUILDING)
        if text is None:
            raise MeshNotFoundError(f"there is no mesh {mesh_id}")
        return load_mesh_record(str(text))

    def find(self, *, limit: int = 50, cursor: str | None = None) -> Page[MeshRecord]:
        """Return a page of meshes, newest first; raises `InvalidCursorError`."""
        before = mesh_cursor(cursor)
        found: list[MeshRecord] = []
        with complete_throughout(self._client):
            while True:
                entries, more = self._below(before)
                with reachable():
                    names = [keys.mesh(mesh_id) for _, mesh_id in entries]
                    texts = self._client.mget(names) if names else []
                found += [load_mesh_record(text) for text in texts if text is not None]
                if len(found) > limit:
                    last = found[limit - 1]
                    return Page(tuple(found[:limit]), f"{last.created_at!r}~{last.id}")
                if not more:
                    return Page(tuple(found), None)
                before = entries[-1]

    def _below(self, before: tuple[float, str]) -> tuple[list[tuple[float, str]], bool]:
        """Return the next entries (time, id) below one, newest first, and whether there may be more.

        By place and not by offset, which meshes that come and go meanwhile would shift.
        """
        moment = repr(before[0])
        with reachable(), self._client.pipeline(transaction=True) as pipe:
            pipe.zrevrangebyscore(keys.MESHES, moment, moment, withscores=True)
            pipe.zrevrangebyscore(keys.MESHES, f"({moment}", "-inf", 0, _CHUNK, withscores=True)
            same, older = pipe.execute()
        entries = [(created, mesh_id) for mesh_id, created in (*same, *older)]
        return [entry for entry in entries if entry < before], len(older) == _CHUNK

    def delete(self, mesh_id: str) -> None:
        """Forget a mesh; raises `MeshInUseError` while any job names it, `MeshNotFoundError`."""
        answer = self._scripts(
            "delete_mesh",
            [keys.mesh(mesh_id), keys.MESHES, keys.BY_MESH + mesh_id, keys.EPOCH],
            [mesh_id],
            common=False,
        )
        if answer == "incomplete":  # a job that names it may be among those that come back
            raise StoreUnavailableError(REBUILDING)
        if answer == "unknown":
            raise MeshNotFoundError(f"there is no mesh {mesh_id}")
        if answer == "in-use":
            raise MeshInUseError(f"a job names the mesh {mesh_id}: delete the job first")

    def unknown(self, mesh_ids: Sequence[str]) -> list[str]:
        """Return those of which there is no record."""
        with reachable(), self._client.pipeline(transaction=False) as pipe:
            for mesh_id in mesh_ids:
                pipe.exists(keys.mesh(mesh_id))
            return [mesh_id for mesh_id, found in zip(mesh_ids, pipe.execute(), strict=True) if not found]


def mesh_cursor(cursor: str | None) -> tuple[float, str]:
    """Return the time and id that a page of meshes begins below; raises `InvalidCursorError`."""
    if cursor is None:
        return (float("inf"), "")
    seconds, _, mesh_id = cursor.partition("~")
    try:
        created = float(seconds)
    except ValueError as e:
        raise InvalidCursorError(f"{cursor!r} is no cursor of this listing") from e
    if not mesh_id or math.isnan(created):
        raise InvalidCursorError(f"{cursor!r} is no cursor of this listing")
    return (created, mesh_id)
