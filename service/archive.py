"""A finished job as one file: manifest.json, metrics.csv and every kept state; the same bytes every time."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import stat
import zipfile
from collections.abc import Callable, Generator, Iterator
from contextlib import closing
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any, BinaryIO, Final

from service.delivery import PIECE, file_name
from service.schemas import MetricsOut, RowOut, figures
from spherify import __version__
from spherify.jobs.model import Job, MeshRecord, Snapshot

MEDIA_TYPE: Final = "application/zip"
STREAMED_BYTES: Final = 256 * 1024 * 1024  # of kept states: more are sent as they are written, and not kept
_TEXT: Final = frozenset({"obj", "off"})  # binary positions hardly shrink
_READABLE: Final = stat.S_IRUSR | stat.S_IWUSR | stat.S_IRGRP | stat.S_IROTH
_FIRST: Final = datetime(1980, 1, 1, tzinfo=UTC)  # before it a zip file has no times


def metrics_csv(metrics: MetricsOut) -> bytes:
    """Return the time series as CSV (RFC 4180), a header line first."""
    names = ["iteration", *(name for name in RowOut.model_fields if name != "iteration")]
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, names, lineterminator="\r\n")
    writer.writeheader()
    writer.writerows(row.model_dump() for row in metrics.rows)
    return text.getvalue().encode()


@dataclass(frozen=True, slots=True)
class Matter:
    """What an archive is made of.

    Attributes:
        job: finished.
        form: of the states, by its ending.
        convert: returns a state in that form.

    """

    job: Job
    mesh: MeshRecord
    metrics: MetricsOut
    form: str
    convert: Callable[[Snapshot], bytes]


def write_archive(file: BinaryIO, matter: Matter) -> None:
    """Write the archive of a finished job, one state at a time; entries are dated as the job was made."""
    for _ in _entries(file, matter):
        pass


def archive_parts(scratch: Path, matter: Matter) -> Generator[Iterator[bytes], None, None]:
    """Yield the same archive an entry at a time, to be read before the next one is made.

    An entry waits on the disk, without a name: clients that take their time hold no memory.
    """
    with TemporaryFile(dir=scratch) as file:
        window = _Window(file)
        with closing(_entries(window, matter)) as entries:
            for _ in entries:
                yield window.take()
        yield window.take()


class _Window:
    """A file that holds what was written since it was last taken, at its place in the whole.

    A zip file is written forwards, but for the head of an entry, which learns its size and sum when it ends.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._before = 0

    def write(self, data: bytes, /) -> int:
        return self._file.write(data)

    def flush(self) -> None:
        self._file.flush()

    def close(self) -> None:
        self._file.close()

    def tell(self) -> int:
        return self._before + self._file.tell()

    def seek(self, offset: int, whence: int = io.SEEK_SET, /) -> int:
        place = offset - self._before if whence == io.SEEK_SET else offset
        return self._before + self._file.seek(place, whence)

    def take(self) -> Iterator[bytes]:
        """Yield what is there, piece by piece, and forget it."""
        self._before += self._file.seek(0, io.SEEK_END)
        self._file.seek(0)
        while piece := self._file.read(PIECE):
            yield piece
        self._file.seek(0)
        self._file.truncate()


def _entries(file: BinaryIO | _Window, matter: Matter) -> Generator[None, None, None]:
    """Write an archive, and stop after each entry, holding nothing of it."""
    job, form = matter.job, matter.form
    made = max(datetime.fromtimestamp(int(job.spec.created_at), UTC), _FIRST)
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED, allowZip64=True) as archive:

        def add(name: str, data: bytes, *, text: bool) -> str:
            entry = zipfile.ZipInfo(name, made.timetuple()[:6])
            entry.external_attr = _READABLE << 16
            entry.compress_type = zipfile.ZIP_DEFLATED if text else zipfile.ZIP_STORED
            archive.writestr(entry, data)
            return hashlib.sha256(data).hexdigest()

        def add_state(snapshot: Snapshot) -> dict[str, Any]:
            data = matter.convert(snapshot)
            name = file_name(job.spec.name, f"_it{snapshot.iteration:05d}.{form}")
            return {
                "name": name,
                "iteration": snapshot.iteration,
                "bytes": len(data),
                "sha256": add(name, data, text=form in _TEXT),
                "metrics": figures(snapshot.metrics).model_dump(),
            }

        states: list[dict[str, Any]] = []
        for snapshot in job.snapshots:
            states.append(add_state(snapshot))
            yield
        table = metrics_csv(matter.metrics)
        series = {"name": "metrics.csv", "bytes": len(table), "sha256": add("metrics.csv", table, text=True)}
        manifest = _manifest(job, matter.mesh) | {"snapshots": states, "metrics": series}
        add("manifest.json", json.dumps(manifest, indent=2, ensure_ascii=False).encode(), text=True)


def _manifest(job: Job, mesh: MeshRecord) -> dict[str, Any]:
    return {
        "spherify": __version__,
        "job": {
            "id": job.id,
            "parent_id": job.spec.parent_id,
            "name": job.spec.name,
            "tags": list(job.spec.tags),
            "status": job.status.value,
            "stop_reason": job.stop_reason,
            "stop_detail": job.stop_detail,
            "result_iteration": job.result_iteration,
            "best_iteration": job.best_iteration,
            "preset": job.spec.preset,
            "parameters": job.spec.parameters,
        },
        "mesh": {
            "id": mesh.id,
            "name": mesh.name,
            "sha256": mesh.sha256,
            "format": mesh.format,
            "allow": list(mesh.allow),
            "vertices": mesh.report.get("vertices"),
            "faces": mesh.report.get("faces"),
        },
    }
