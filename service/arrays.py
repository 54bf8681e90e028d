"""Bare arrays as answers: topology, positions and fields, compressed where the client takes it, built once."""

from __future__ import annotations

import gzip
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any, BinaryIO, Final

from starlette.requests import Request
from starlette.responses import Response

from service.context import Services
from service.delivery import Content, accepts_gzip, deliver
from spherify import __version__
from spherify.formats.viewer import PositionType, positions_bytes, scalars_bytes, topology_bytes
from spherify.geometry.fields import FieldName, vertex_field
from spherify.geometry.mesh import TriangleMesh
from spherify.jobs import layout
from spherify.jobs.errors import BlobNotFoundError, DamagedBlobError
from spherify.jobs.model import MeshRecord, Snapshot
from spherify.jobs.ports import BlobStore
from spherify.stores.arrays import load_arrays

MEDIA_TYPE: Final = "application/octet-stream"
VARY: Final = "Accept-Encoding"
_DAMAGED_MESH: Final = "delete it, and before it the jobs that name it, and upload it again"
_MISSING_MESH: Final = "upload it again"  # what is missing of a known mesh is written then
_OF_JOB: Final = "delete the job and send it again"
_LEVEL: Final = 6  # beyond it twice the time saves a hundredth


@dataclass(frozen=True, slots=True)
class State:
    """Positions over a mesh's triangles: those it came with, or those of a snapshot."""

    mesh_id: str
    snapshot: Snapshot | None = None

    @property
    def source(self) -> str:
        """A name of the positions' content."""
        return self.mesh_id if self.snapshot is None else f"{self.mesh_id} {self.snapshot.sha256}"

    def load(self, blobs: BlobStore) -> tuple[TriangleMesh, TriangleMesh]:
        """Return the mesh at the start, and the state."""
        start = load_mesh(blobs, self.mesh_id)
        if self.snapshot is None:
            return start, start
        return start, start.with_vertices(_snapshot_arrays(blobs, self.snapshot)["vertices"])


def load_mesh(blobs: BlobStore, mesh_id: str) -> TriangleMesh:
    """Return an accepted mesh."""
    arrays = _mesh_arrays(blobs, mesh_id)
    return TriangleMesh.checked(arrays["vertices"], arrays["faces"])


def open_original(blobs: BlobStore, record: MeshRecord) -> BinaryIO:
    """Return an uploaded file as it was."""
    try:
        return blobs.open(layout.mesh_original(record.id, record.format))
    except BlobNotFoundError as e:
        raise BlobNotFoundError(f"the uploaded file of {record.id} is missing: {_MISSING_MESH}") from e


def verify_original(record: MeshRecord, digest: bytes) -> None:
    """Raise `DamagedBlobError` unless this is the SHA-256 that an uploaded file had."""
    if digest.hex() != record.sha256:
        raise DamagedBlobError(f"the uploaded file of {record.id} is damaged: {_DAMAGED_MESH}")


def _mesh_arrays(blobs: BlobStore, mesh_id: str) -> Mapping[str, Any]:
    key = layout.mesh_arrays(mesh_id)
    return _arrays(blobs, key, f"the stored mesh {mesh_id}", damaged=_DAMAGED_MESH, missing=_MISSING_MESH)


def _snapshot_arrays(blobs: BlobStore, snapshot: Snapshot) -> Mapping[str, Any]:
    which = f"the snapshot of iteration {snapshot.iteration} of {layout.job_of(snapshot.key)}"
    return _arrays(blobs, snapshot.key, which, damaged=_OF_JOB, missing=_OF_JOB)


def _arrays(blobs: BlobStore, key: str, what: str, *, damaged: str, missing: str) -> Mapping[str, Any]:
    """Return the arrays of a file; what is wrong with it is said with the cure."""
    try:
        return load_arrays(blobs.read(key))
    except DamagedBlobError as e:
        raise DamagedBlobError(f"{what} is damaged: {damaged}") from e
    except BlobNotFoundError as e:
        raise BlobNotFoundError(f"{what} is missing: {missing}") from e


async def topology(request: Request, services: Services, mesh_id: str, cache_control: str) -> Response:
    """Answer with the triangles of a mesh."""
    blobs = services.stores.blobs

    def build() -> bytes:
        return topology_bytes(_mesh_arrays(blobs, mesh_id)["faces"])

    return await _answer(request, services, ("topology", mesh_id), build, cache_control)


async def positions(
    request: Request, services: Services, state: State, dtype: PositionType, cache_control: str
) -> Response:
    """Answer with the positions of a state."""
    blobs = services.stores.blobs

    def build() -> bytes:
        return positions_bytes(state.load(blobs)[1].vertices, dtype)

    return await _answer(request, services, ("positions", state.source, dtype), build, cache_control)


async def field(
    request: Request, services: Services, state: State, name: FieldName, cache_control: str
) -> Response:
    """Answer with a scalar field over the vertices of a state."""
    blobs = services.stores.blobs

    def build() -> bytes:
        start, now = state.load(blobs)
        return scalars_bytes(vertex_field(name, start, now.vertices))

    return await _answer(request, services, ("field", state.source, name), build, cache_control)


async def _answer(
    request: Request,
    services: Services,
    parts: Collection[str],
    build: Callable[[], bytes],
    cache_control: str,
) -> Response:
    zipped = accepts_gzip(request)

    def write(file: BinaryIO) -> None:
        data = build()
        file.write(gzip.compress(data, _LEVEL, mtime=0) if zipped else data)

    with await services.cache.get((*parts, zipped, __version__), write, services.views) as file:
        content = Content(
            size=file.size,
            etag=file.etag,
            media_type=MEDIA_TYPE,
            filename=None,
            cache_control=cache_control,
            open=file.take,
            verify=file.verify,
            encoding="gzip" if zipped else None,
        )
        return deliver(request, content, VARY)
