"""The process that computes: one order comes down its pipe, events go up.

It knows files and a pipe, nothing of Redis or Celery, and ends with its supervisor, whatever happens to that one.
Usually it is forked, see `worker.fork_server`; ``python -m worker.runner PARENT_PID`` is one with its order on
standard input and its events on standard output.
"""

from __future__ import annotations

import importlib
import os
import resource
import signal
import sys
import threading
import traceback
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from time import monotonic
from types import FrameType
from typing import Any, BinaryIO, Final, NoReturn

from numpy.typing import NDArray

from spherify.geometry.errors import GeometryError, InvalidCheckpointError
from spherify.geometry.flow import engine_for
from spherify.geometry.kernels import default_engine
from spherify.geometry.mesh import TriangleMesh
from spherify.geometry.schedule import SnapshotPlan
from spherify.jobs import layout
from spherify.jobs.codec import load_spec
from spherify.jobs.errors import (
    BlobNotFoundError,
    DamagedBlobError,
    StorageFullError,
    StoreUnavailableError,
)
from spherify.jobs.model import JobSpec, Progress
from spherify.jobs.outcome import internal_error, outcome_of
from spherify.jobs.ports import BlobStore
from spherify.jobs.rows import Row
from spherify.jobs.run import Kept, RunEnd, Stop, run
from spherify.parameters import stored_parameters
from spherify.stores.arrays import checksum_of, dump_arrays, load_arrays
from spherify.stores.files import open_blobs
from spherify.stores.states import rows_in, run_of, snapshot_record
from spherify.stores.tether import die_with_parent
from worker.orders import CANCEL_SIGNAL, HAND_ON_SIGNAL, Order, event_line
from worker.resume import Resumption, find_resumption, others_of_run

_PATIENCE_S: Final = (
    60.0  # with a store that does not answer: the lease is renewed meanwhile, and work is not lost
)
_ABANDONED: Final = 3  # exit code: the supervisor is gone


class PipeSink:
    """A `spherify.jobs.run.Sink`: files into the blob store, then their names up the pipe.

    Attributes:
        found: what this attempt goes on from; its snapshots are told before anything of its own. Where some that
            earlier attempts left is of another run, what stays is told before that, with the further snapshots of
            this run: at once if there is something to go on from, else with the first state, which says whose it is.

    """

    def __init__(self, blobs: BlobStore, order: Order, pipe: BinaryIO) -> None:
        self.blobs = blobs
        self.order = order
        self.found = Resumption()
        self._pipe = pipe

    def snapshot(self, kept: Kept) -> None:
        """Write the file, then say so."""
        self._take_over(kept.arrays)
        content = dump_arrays(kept.arrays)
        key = layout.numbered(layout.snapshots(self.order.job_id), self.order.token, kept.iteration)
        stat = self.blobs.create(key, content)
        record = snapshot_record(kept.iteration, stat, checksum_of(content), kept.row)
        self.send("snapshot", snapshot=asdict(record))

    def checkpoint(self, kept: Kept) -> None:
        """Write the file, then remove the older ones but the last; those of a later attempt are not ours."""
        folder = layout.checkpoints(self.order.job_id)
        key = layout.numbered(folder, self.order.token, kept.iteration)
        self.blobs.create(key, dump_arrays(kept.arrays))
        numbers = layout.numbers(key)
        stats = layout.numbered_only(self.blobs.list(folder))
        older = sorted((layout.numbers(stat.key), stat.key) for stat in stats)
        for _, name in [pair for pair in older if pair[0] < numbers][:-1]:  # one, should this one be damaged
            self.blobs.delete(name)

    def report(self, progress: Progress, rows: Sequence[Row]) -> None:
        """Say how far it is."""
        self.send("report", progress=asdict(progress), rows=list(rows))

    def send(self, event: str, **content: object) -> None:
        """Write one event and flush it."""
        if self.found.arrays is not None:
            self._take_over(self.found.arrays)
        self._pipe.write(event_line(event, **content))
        self._pipe.flush()

    def _take_over(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Tell, once, what stays of what earlier attempts left, by the first state of this one."""
        found, self.found = self.found, Resumption()
        state = state if found.arrays is None else found.arrays
        run = run_of(state)
        if found.passed - {run}:
            kept = [snapshot.iteration for snapshot in found.snapshots]
            rows = [int(row["iteration"]) for row in rows_in(state)]  # also those that were told a moment ago
            others = [asdict(other) for other in others_of_run(self.blobs, self.order.job_id, found, run)]
            self._pipe.write(event_line("anew", snapshots=kept, rows=rows, others=others))
        for snapshot in found.snapshots:
            self._pipe.write(event_line("snapshot", snapshot=asdict(snapshot)))


def work(order: Order, pipe: BinaryIO, told: list[Stop]) -> None:
    """Do what the order says; whatever goes wrong in a way that would go wrong again becomes an event."""
    blobs = open_blobs(order.blobs, Path(order.data_dir), patience_s=_PATIENCE_S)
    sink = PipeSink(blobs, order, pipe)
    since = monotonic()  # files that are read count, as for the supervisor
    try:
        _limit_memory(order.memory_bytes)
        spec = load_spec(blobs.read(layout.spec(order.job_id)))
        mesh = _mesh(blobs, spec.mesh_id)
        end = _run(mesh, spec, sink, told, since)
    except MemoryError:
        _limit_memory(resource.RLIM_INFINITY)  # what remains to be done is small, and has to be said
        detail = f"the job needs more memory than the {order.memory_bytes / 2**20:.0f} MiB a runner may have"
        sink.send("failed", code="out-of-memory", detail=f"{detail}: use a smaller mesh")
    except (
        StoreUnavailableError
    ) as e:  # the job is not to blame: it waits for better times, at its last checkpoint
        _note(f"{order.job_id}: handed on, {e}")
        sink.send("handed-on")
    except StorageFullError as e:
        if told and told[-1] is Stop.HAND_ON:  # then the next attempt begins at what is kept already
            _note(f"{order.job_id}: handed on without its last state, {e}")
            sink.send("handed-on")
        else:
            sink.send("failed", code="storage-full", detail=f"{e}: delete jobs that are no longer needed")
    except (BlobNotFoundError, DamagedBlobError) as e:
        sink.send("failed", code="mesh-missing", detail=f"a file of this job cannot be read: {e}")
    except GeometryError as e:
        sink.send("failed", code="invalid-mesh", detail=str(e))
    except Exception as e:  # noqa: BLE001 (whatever it is, it would come again: it is named, not retried)
        traceback.print_exc()
        error = internal_error(order.job_id, f"{type(e).__name__}: {e}")
        sink.send("failed", code=error.code, detail=error.detail)
    else:
        if end.stop_reason is None:
            sink.send("handed-on")
        else:
            sink.send(
                "end",
                outcome=asdict(outcome_of(end)),
                progress=asdict(end.progress),
                rows=list(end.rows),
            )


def _mesh(blobs: BlobStore, mesh_id: str) -> TriangleMesh:
    """Return the job's mesh; what is wrong with its file is said with the cure."""
    try:
        arrays = load_arrays(blobs.read(layout.mesh_arrays(mesh_id)))
    except BlobNotFoundError as e:
        raise BlobNotFoundError(f"the stored mesh {mesh_id} is missing: upload it again, and retry") from e
    except DamagedBlobError as e:
        cure = "delete it, and before it the jobs that name it, and upload it again"
        raise DamagedBlobError(f"the stored mesh {mesh_id} is damaged: {cure}") from e
    return TriangleMesh.checked(arrays["vertices"], arrays["faces"])


def _run(mesh: TriangleMesh, spec: JobSpec, sink: PipeSink, told: list[Stop], since: float) -> RunEnd:
    config = stored_parameters(spec.parameters).config()
    plan = SnapshotPlan(spec.snapshots_requested)

    foreign: set[bytes] = set()
    while True:  # as often as there are versions whose files it has
        found = sink.found = find_resumption(sink.blobs, spec.id, plan, foreign)
        engine = engine_for(
            mesh, config, found.arrays, engine=sink.order.engine, threads=sink.order.threads, say=_note
        )
        try:
            return run(
                mesh,
                config,
                plan,
                sink,
                engine=engine,
                resume=found.arrays,
                stop=lambda: told[-1] if told else None,
                deadline_s=sink.order.deadline_s,
                limit_s=sink.order.limit_s,
                since=since,
                checkpoint_s=sink.order.checkpoint_s,
            )
        except InvalidCheckpointError as e:  # at once: of another version of the program, most likely
            if found.arrays is None:
                raise
            foreign.add(run_of(found.arrays))
            _note(f"{spec.id}: the states of an earlier attempt are passed over, {e}")


def _note(sentence: str) -> None:
    with suppress(OSError):  # the disk of the log may be full, and the job is not to end with that
        sys.stderr.write(f"{sentence}\n")


def _limit_memory(limit: int) -> None:
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    if hard != resource.RLIM_INFINITY:
        limit = hard if limit == resource.RLIM_INFINITY else min(limit, hard)
    resource.setrlimit(resource.RLIMIT_AS, (limit, hard))


def get_ready() -> None:
    """Load what a job may need, and the machine code of the kernels, which is made once on a machine."""
    importlib.import_module(
        "spherify.geometry.methods.implicit"
    )  # with scipy's solvers: else loaded when needed
    default_engine().warm()


def obey(orders: int, events: int) -> NoReturn:
    """Say that signals are heard, take one order and carry it out, and end this process.

    Args:
        orders: file descriptor the order comes from, and then nothing until the supervisor is gone.
        events: file descriptor of the events.

    """
    told: list[Stop] = []

    def hear(number: int, _frame: FrameType | None) -> None:
        told.append(Stop.CANCEL if number == CANCEL_SIGNAL else Stop.HAND_ON)

    try:
        signal.signal(CANCEL_SIGNAL, hear)
        signal.signal(HAND_ON_SIGNAL, hear)
        _volunteer_for_lack_of_memory()
        with os.fdopen(events, "wb") as pipe:
            pipe.write(event_line("ready", pid=os.getpid()))
            pipe.flush()
            line = _first_line(orders)
            threading.Thread(target=_leave_when_abandoned, args=(orders,), daemon=True).start()
            work(Order.parse(line), pipe, told)
    except BaseException:  # noqa: BLE001 (nobody is there to catch it, and the usual end would take its time)
        traceback.print_exc()
        os._exit(1)
    os._exit(0)  # all is written and flushed; tearing the interpreter down would keep the job waiting


def _first_line(orders: int) -> bytes:
    """Return the order; byte by byte, for what follows belongs to another thread."""
    line = b""
    while not line.endswith(b"\n"):
        byte = os.read(orders, 1)
        if not byte:
            os._exit(0)  # no job came
        line += byte
    return line


def _leave_when_abandoned(orders: int) -> None:
    """Wait for the end of the orders: then there is no supervisor any more (where there is no tether)."""
    os.read(orders, 1)
    os._exit(_ABANDONED)


def _volunteer_for_lack_of_memory() -> None:
    """Have the kernel end this process, not the one that would tell of it, when the machine runs out of memory."""
    if sys.platform.startswith("linux"):
        Path("/proc/self/oom_score_adj").write_text("1000", "ascii")


def main() -> None:
    """Be a runner that was not forked."""
    die_with_parent(int(sys.argv[1]))
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the worker, which hands on
    events = os.dup(1)
    os.dup2(2, 1)  # whatever prints does not get among the events
    get_ready()
    obey(0, events)


if __name__ == "__main__":
    main()
