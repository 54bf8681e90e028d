"""From an uploaded file to an accepted mesh: read in a child process, judged, stored once, then recorded."""

from __future__ import annotations

import base64
import hashlib
import logging
import time
from collections.abc import Collection
from contextlib import suppress
from typing import TYPE_CHECKING, Final

from anyio import CapacityLimiter, to_thread

from service.problems import ProblemError
from spherify.formats import MeshRefusedError, ReadLimits, read_mesh
from spherify.formats.errors import UnreadableError
from spherify.formats.names import safe_name
from spherify.formats.sniff import check_name
from spherify.jobs import layout
from spherify.jobs.codec import dump_record, load_mesh_record
from spherify.jobs.errors import (
    BlobExistsError,
    BlobNotFoundError,
    DamagedBlobError,
    MeshNotFoundError,
    StorageFullError,
    StoreUnavailableError,
)
from spherify.jobs.model import MeshRecord
from spherify.stores.arrays import dump_arrays

if TYPE_CHECKING:
    from service.uploads import Upload
    from spherify.jobs.ports import BlobStore, MeshStore
    from spherify.settings import Settings

LOCATIONS: Final = 10  # of each defect that a record keeps; the answer to a refused mesh has more
READINGS: Final = 2  # at once: each may take gigabytes for seconds
WAITING: Final = 64  # uploads that may wait for a reading; more are told to come back
_TRIES: Final = 3  # at a record's file that others write, replace and delete
_CROCKFORD: Final = str.maketrans("ABCDEFGHIJKLMNOPQRSTUVWXYZ234567", "0123456789ABCDEFGHJKMNPQRSTVWXYZ")
log = logging.getLogger(__name__)


def mesh_id(sha256: str, allow: Collection[str]) -> str:
    """Return the identifier of these bytes read with these switches: 26 base-32 digits of their hash."""
    digest = hashlib.sha256("\n".join([sha256, *sorted(set(allow))]).encode()).digest()
    return "mesh_" + base64.b32encode(digest).decode()[:26].translate(_CROCKFORD)


class Intake:
    """The way in for meshes; a few are read at a time, whatever the number of uploads."""

    def __init__(self, meshes: MeshStore, blobs: BlobStore, settings: Settings) -> None:
        self._meshes = meshes
        self._blobs = blobs
        self._limits = ReadLimits(max_vertices=settings.max_vertices, max_faces=settings.max_faces)
        self._readings = CapacityLimiter(READINGS)

    async def accept(self, upload: Upload, allow: Collection[str]) -> tuple[MeshRecord, bool]:
        """Return the record of an uploaded mesh, and whether it is new.

        Raises:
            MeshRefusedError: it is no mesh that can be morphed.
            ReaderKilledError: there was not the memory to read it.
            ProblemError: rate-limited.
            StorageFullError, StoreUnavailableError: it could not be kept.

        """
        known = await to_thread.run_sync(self._known, mesh_id(upload.sha256, allow))
        if known is not None:
            _check_name(upload.name, known)
            return known, False
        if self._readings.statistics().tasks_waiting >= WAITING:
            raise ProblemError("rate-limited", f"{WAITING} meshes wait to be read already")
        return await to_thread.run_sync(self._read, upload, frozenset(allow), limiter=self._readings)

    def _known(self, identifier: str) -> MeshRecord | None:
        try:
            record = self._meshes.get(identifier)
        except MeshNotFoundError:
            return None
        return record if self._whole(record) else None

    def _whole(self, record: MeshRecord) -> bool:
        keys = (
            layout.mesh_original(record.id, record.format),
            layout.mesh_arrays(record.id),
            layout.mesh_record(record.id),
        )
        return all(self._blobs.stat(key) is not None for key in keys)

    def _read(self, upload: Upload, allow: frozenset[str]) -> tuple[MeshRecord, bool]:
        read = read_mesh(upload.path, upload.name, allow=allow, limits=self._limits)
        record = MeshRecord(
            id=mesh_id(upload.sha256, allow),
            name=safe_name(upload.name),
            sha256=upload.sha256,
            size=upload.size,
            format=read.report.format,
            allow=tuple(sorted(allow)),
            report=read.report.as_dict(most_locations=LOCATIONS),
            created_at=time.time(),
        )
        arrays = {"vertices": read.mesh.vertices, "faces": read.mesh.faces}
        return self._keep(record, dump_arrays(arrays), upload)

    def _keep(self, record: MeshRecord, arrays: bytes, upload: Upload) -> tuple[MeshRecord, bool]:
        """Write the files, the record's last, then record it; what another upload wrote already stays."""
        original = layout.mesh_original(record.id, record.format)
        ours: list[str] = []
        try:
            with suppress(BlobExistsError):  # by the same bytes, a moment earlier
                ours.append(self._blobs.adopt(original, upload.path).key)
            with suppress(BlobExistsError):
                ours.append(self._blobs.create(layout.mesh_arrays(record.id), arrays).key)
            kept = self._written(record)
        except StorageFullError:  # nothing names these files yet, and they would keep the disk full
            for key in ours:
                self._blobs.delete(key)
            raise
        new = self._meshes.add(kept)
        if not self._whole(kept):  # the same mesh was being deleted
            raise StoreUnavailableError("this mesh was deleted at the same moment: send it again")
        return kept, new

    def _written(self, record: MeshRecord) -> MeshRecord:
        """Write the record's file, unless there is an intact one, which then counts; a damaged one is replaced."""
        key, text = layout.mesh_record(record.id), dump_record(record).encode()
        for _ in range(_TRIES):
            with suppress(BlobExistsError):
                self._blobs.create(key, text)
                return load_mesh_record(text)  # as all others read it
            try:
                kept = load_mesh_record(self._blobs.read(key))
            except BlobNotFoundError:  # it was being deleted
                continue
            except (DamagedBlobError, ValueError, LookupError, TypeError) as e:
                log.warning(
                    "its record's file is damaged: %r", e, extra={"action": "upload", "mesh_id": record.id}
                )
            else:
                if _content(kept) == _content(record) and self._whole(kept):
                    return kept
            self._blobs.delete(key)
        raise StoreUnavailableError("this mesh was written or deleted at the same moment: send it again")


def _check_name(name: str, known: MeshRecord) -> None:
    """Hold a name against bytes that were read before, as a first reading would; raises `MeshRefusedError`."""
    try:
        check_name(name, known.format)
    except UnreadableError as e:
        raise MeshRefusedError(e.code, str(e)) from e


def _content(record: MeshRecord) -> tuple[object, ...]:
    """Return what the same bytes have in common, whoever sent them, and under which name."""
    return record.id, record.sha256, record.size, record.allow
