"""The only loop over `flow`: what is kept, what is reported, and when a run is left.

A worker's runner and the command line both call `run`, each with a sink of its own, so that a job over the API
ends with the same bytes as a local one; and every snapshot holds all a later call needs to go on, so that a run
that was killed does too.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, Final, Protocol

from numpy.typing import NDArray

from spherify.geometry.config import Config
from spherify.geometry.flow import FlowState, StopReason, flow
from spherify.geometry.kernels import Engine
from spherify.geometry.mesh import TriangleMesh
from spherify.geometry.schedule import SnapshotPlan, is_recorded
from spherify.jobs.model import Progress
from spherify.jobs.rows import BEST, ROWS, Row, rows_to_array, rows_to_list

REPORT_S: Final = 0.5  # progress at most twice a second, and with every planned state
CHECKPOINT_S: Final = 60.0  # a lost worker costs at most this much computing
_RATE_S: Final = 5.0  # the rate is that of the last seconds
_FLUSH_ROWS: Final = 500


class Stop(Enum):
    """Why the caller leaves a run before its end."""

    CANCEL = "cancel"  # for good: the state is kept as a snapshot
    HAND_ON = "hand on"  # somebody else goes on: the state is kept as a checkpoint


@dataclass(frozen=True, eq=False, slots=True)
class Kept:
    """A state to be made durable.

    Attributes:
        iteration: iterations done.
        arrays: what the file holds: ``vertices``, ``metrics`` (all rows so far), and, unless this is a best
            state seen in hindsight, the state of the flow.
        row: the figures of this state, ``iteration`` among them.

    """

    iteration: int
    arrays: Mapping[str, NDArray[Any]]
    row: Row


class Sink(Protocol):
    """Where a run's states and figures go. What has been handed over is durable when the call returns."""

    def snapshot(self, kept: Kept) -> None:
        """Keep a state for good; called once an iteration."""
        ...

    def checkpoint(self, kept: Kept) -> None:
        """Keep a state until the next one is kept, to go on from."""
        ...

    def report(self, progress: Progress, rows: Sequence[Row]) -> None:
        """Tell how far it is, and the rows since the last call. Never of the last state: `RunEnd` does that."""
        ...


@dataclass(frozen=True, slots=True)
class RunEnd:
    """How a run ended; everything it kept is durable.

    Attributes:
        stop_reason: None if it was handed on.
        stop_detail: a sentence about it.
        iteration: of the last state, which was kept.
        best_iteration: of the state of the highest sphericity, which was kept too unless the run was handed on.
        sphericity: of the last state.
        progress: at the end; after a collapse it stands where the run broke, not at the state that was kept.
        rows: those not reported yet.

    """

    stop_reason: StopReason | None
    stop_detail: str | None
    iteration: int
    best_iteration: int
    sphericity: float
    progress: Progress
    rows: tuple[Row, ...]


def run(
    mesh: TriangleMesh,
    config: Config,
    plan: SnapshotPlan,
    sink: Sink,
    *,
    engine: Engine | str | None = None,
    resume: Mapping[str, NDArray[Any]] | None = None,
    stop: Callable[[], Stop | None] = lambda: None,
    deadline_s: float = float("inf"),
    limit_s: float | None = None,
    since: float | None = None,
    checkpoint_s: float = CHECKPOINT_S,
    clock: Callable[[], float] = time.monotonic,
) -> RunEnd:
    """Run the flow to its end, its deadline, or until `stop` says so, which is asked after every iteration.

    Args:
        mesh: to be morphed.
        config: parameters.
        plan: iterations whose states are kept. The last state is kept too, and the best one.
        sink: where everything goes; what it raises passes through.
        engine: who computes; by default the one of what is resumed, else the default one.
        resume: the arrays of a snapshot or checkpoint of the same run, see `Kept`.
        stop: see `Stop`.
        deadline_s: seconds of computing that are left to this call.
        limit_s: seconds of which those are the rest, to be named at the deadline; None: they are all.
        since: the moment they count from, by the clock; None is this call.
        checkpoint_s: seconds between states kept to go on from.
        clock: seconds, never going back.

    Raises:
        InvalidMeshError, InvalidCheckpointError: at once.

    """
    return _Run(config, plan, sink, resume, clock=clock, checkpoint_s=checkpoint_s).to_the_end(
        flow(mesh, config, engine=engine, resume=resume),
        stop,
        deadline_s,
        deadline_s if limit_s is None else limit_s,
        since,
    )


def limit_reached(limit_s: float) -> str:
    """Return the beginning of a sentence on a time limit that was reached."""
    return f"the limit of {limit_s:g} s, all attempts together, was up"


class _Run:
    """The books of one call: rows, what has been kept, the best state, time."""

    def __init__(
        self,
        config: Config,
        plan: SnapshotPlan,
        sink: Sink,
        resume: Mapping[str, NDArray[Any]] | None,
        *,
        clock: Callable[[], float],
        checkpoint_s: float,
    ) -> None:
        self._total = config.iterations
        self._plan = plan
        self._planned = frozenset(plan.iterations)
        self._sink = sink
        self._clock = clock
        self._checkpoint_s = checkpoint_s
        self._began = self._reported_at = self._kept_at = clock()
        self._pace: deque[tuple[float, int]] = deque()
        earlier = [] if resume is None else rows_to_list(resume[ROWS])
        self._rows: dict[int, Row] = {int(row["iteration"]): row for row in earlier}
        self._unreported: list[Row] = list(earlier)
        self._best: FlowState | None = None  # None: it was seen before the resumption, and this is its row
        self._best_row = None if resume is None else rows_to_list(resume[BEST])[0]
        self._kept = {i for i in self._rows if i in self._planned}

    def to_the_end(
        self,
        states: Iterator[FlowState],
        stop: Callable[[], Stop | None],
        deadline_s: float,
        limit_s: float,
        since: float | None,
    ) -> RunEnd:
        """Follow the states; see `run`."""
        since = self._began if since is None else since
        for state in states:
            if state.best_iteration == state.iteration:
                self._best, self._best_row = state, None
            if state.stop_reason is not None:
                return self._end(state, state.stop_reason, state.stop_detail)
            told = stop()
            if told is Stop.CANCEL:
                return self._end(state, StopReason.CANCELLED, f"cancelled after iteration {state.iteration}")
            if told is Stop.HAND_ON:
                self._keep(state, to_leave=True)  # the next attempt begins after it
                return self._left(state, None, None)
            if self._clock() - since >= deadline_s:
                detail = f"{limit_reached(limit_s)} after iteration {state.iteration}"
                return self._end(state, StopReason.DEADLINE, detail)
            self._keep(state)
        raise AssertionError("a flow ends with a reason")

    def _keep(self, state: FlowState, *, to_leave: bool = False) -> None:
        """Keep what is due of a state, and in any case as much as is needed to go on, before the run is left."""
        if is_recorded(state.iteration, self._total, self._plan):
            self._record(state)
        now = self._clock()
        planned = state.iteration in self._planned
        if planned:  # told before it is kept, so that no state is known that progress has not come to
            self._report(state)
            self._snapshot(self._whole(state))
        elif to_leave or now - self._kept_at >= self._checkpoint_s:
            self._sink.checkpoint(self._whole(state))
            self._kept_at = self._clock()
        if not planned and (now - self._reported_at >= REPORT_S or len(self._unreported) > _FLUSH_ROWS):
            self._report(state)

    def _report(self, state: FlowState) -> None:
        self._sink.report(self._progress(state.iteration), self._take_rows())
        self._reported_at = self._clock()

    def _end(self, state: FlowState, reason: StopReason, detail: str | None) -> RunEnd:
        """Keep the best state, then the last one: whoever finds the last one finds everything."""
        best = state.best
        self._record(state)
        if best.iteration not in self._kept and best.iteration != state.iteration:
            row = self._best_figures(state)
            self._add(row)
            upto = [self._rows[i] for i in sorted(self._rows) if i <= best.iteration]
            arrays = {"vertices": best.vertices, ROWS: rows_to_array(upto)}
            self._snapshot(Kept(best.iteration, arrays, row))
        if state.iteration not in self._kept:
            self._snapshot(self._whole(state))
        return self._left(state, reason, detail)

    def _left(self, state: FlowState, reason: StopReason | None, detail: str | None) -> RunEnd:
        return RunEnd(
            stop_reason=reason,
            stop_detail=detail,
            iteration=state.iteration,
            best_iteration=state.best_iteration,
            sphericity=state.sphericity,
            progress=self._progress(state.reached),
            rows=tuple(self._take_rows()),
        )

    def _record(self, state: FlowState) -> Row:
        row = self._rows.get(state.iteration)
        if row is None:
            row = {"iteration": state.iteration, **state.metrics().as_dict()}
            self._add(row)
        return row

    def _add(self, row: Row) -> None:
        if row["iteration"] not in self._rows:
            self._rows[int(row["iteration"])] = row
            self._unreported.append(row)

    def _best_figures(self, state: FlowState) -> Row:
        """Return the figures of the best state, computed once."""
        if self._best_row is None:
            best = self._best or state
            row = self._rows.get(best.iteration)
            self._best_row = row or {"iteration": best.iteration, **best.metrics().as_dict()}
        return self._best_row

    def _whole(self, state: FlowState) -> Kept:
        """Return a state with everything that is needed to go on from it."""
        rows = self._rows.values()  # after a collapse also those beyond the best state, which this then is
        row = self._rows.get(state.iteration) or {"iteration": state.iteration, **state.metrics().as_dict()}
        arrays = {
            **state.checkpoint(),
            ROWS: rows_to_array(sorted(rows, key=lambda row: row["iteration"])),
            BEST: rows_to_array([self._best_figures(state)]),
        }
        return Kept(state.iteration, arrays, row)

    def _snapshot(self, kept: Kept) -> None:
        self._sink.snapshot(kept)
        self._kept.add(kept.iteration)
        self._kept_at = self._clock()

    def _take_rows(self) -> list[Row]:
        rows, self._unreported = sorted(self._unreported, key=lambda row: row["iteration"]), []
        return rows

    def _progress(self, iteration: int) -> Progress:
        now = self._clock()
        self._pace.append((now, iteration))
        while len(self._pace) > 2 and now - self._pace[1][0] >= _RATE_S:
            self._pace.popleft()
        then, before = self._pace[0]
        rate = (iteration - before) / (now - then) if now > then and iteration > before else None
        return Progress(
            iteration=iteration,
            iterations_total=self._total,
            iterations_per_s=rate,
            eta_s=None if rate is None else (self._total - iteration) / rate,
            elapsed_s=now - self._began,
        )
