from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from spherify.geometry.config import FlowConfig
from spherify.geometry.flow import StopReason, flow
from spherify.geometry.mesh import TriangleMesh
from spherify.geometry.samples import SAMPLES
from spherify.geometry.schedule import SnapshotPlan, recorded_iterations
from spherify.jobs.model import JobStatus, Progress
from spherify.jobs.outcome import outcome_of
from spherify.jobs.rows import ROWS, Row, rows_to_list
from spherify.jobs.run import Kept, RunEnd, Stop, run
from spherify.parameters import resolve
from spherify.stores.arrays import dump_arrays, load_arrays
from tests.jobs.examples import stone

CUBE = SAMPLES["cube"].build(60)


@dataclass
class Recorder:
    """A sink that keeps what it is given, as the bytes of a file."""

    snapshots: dict[int, bytes] = field(default_factory=dict)
    checkpoints: dict[int, bytes] = field(default_factory=dict)
    rows: dict[float, Row] = field(default_factory=dict)
    reports: list[Progress] = field(default_factory=list)
    metrics: dict[int, Row] = field(default_factory=dict)
    ahead: bool = False  # whether a state came that progress had not come to

    def snapshot(self, kept: Kept) -> None:
        assert kept.iteration not in self.snapshots
        self.ahead |= not self.reports or kept.iteration > self.reports[-1].iteration
        self.snapshots[kept.iteration] = dump_arrays(kept.arrays)
        self.metrics[kept.iteration] = kept.row

    def checkpoint(self, kept: Kept) -> None:
        self.checkpoints[kept.iteration] = dump_arrays(kept.arrays)

    def report(self, progress: Progress, rows: Sequence[Row]) -> None:
        self.reports.append(progress)
        self.take(rows)

    def take(self, rows: Sequence[Row]) -> None:
        for row in rows:
            assert self.rows.setdefault(row["iteration"], row) == row


def config(preset: str = "robust", **overrides: Any) -> FlowConfig:
    return resolve(preset, overrides).config()


def recorded(
    mesh: TriangleMesh,
    config: FlowConfig,
    plan: str = "",
    resume: Mapping[str, Any] | None = None,
    **options: Any,
) -> tuple[RunEnd, Recorder]:
    sink = Recorder()
    planned = SnapshotPlan.parse(plan, config.iterations)
    end = run(mesh, config, planned, sink, resume=resume, **options)
    sink.take(end.rows)
    return end, sink


def ticking(step_s: float) -> Callable[[], float]:
    """A clock that goes on by a step each time it is looked at."""
    return itertools.count(0.0, step_s).__next__


def stop_at(looks: int, what: Stop) -> Callable[[], Stop | None]:
    seen = itertools.count()
    return lambda: what if next(seen) >= looks else None


def test_planned_states_are_kept_as_the_flow_yields_them() -> None:
    settings = config(iterations=30)
    states = {state.iteration: state for state in flow(stone(), settings)}
    end, sink = recorded(stone(), settings, "7,20")
    assert (end.stop_reason, end.iteration) == (StopReason.ITERATIONS, 30)
    assert set(sink.snapshots) == {0, 7, 20, 30} | {end.best_iteration}
    for iteration, content in sink.snapshots.items():
        assert load_arrays(content)["vertices"].tobytes() == states[iteration].vertices.tobytes()
        assert sink.metrics[iteration] == {
            "iteration": iteration,
            **states[iteration].metrics().as_dict(),
        }


def test_rows_follow_the_rule() -> None:
    settings = config(iterations=540, annealing=None, stop_radius_variation=0)  # to the last iteration
    end, sink = recorded(stone(), settings, "333")
    assert end.stop_reason is StopReason.ITERATIONS
    wanted = {*recorded_iterations(540, SnapshotPlan.parse("333", 540)), *sink.snapshots}
    assert set(sink.rows) == wanted


def test_a_best_state_between_snapshots_is_kept_in_hindsight() -> None:
    settings = config(iterations=60, window=(0, 100), step_bound=0, step=0.5, unfolding=None)
    end, sink = recorded(stone(), settings)
    assert end.best_iteration not in (0, 60)
    assert set(sink.snapshots) == {0, end.best_iteration, 60}
    best = sink.metrics[end.best_iteration]
    assert best["sphericity"] == max(row["sphericity"] for row in sink.rows.values())
    assert load_arrays(sink.snapshots[end.best_iteration])["metrics"][-1]["iteration"] == end.best_iteration


@pytest.mark.parametrize(
    ("mesh", "settings", "plan", "reason", "ticks"),
    [
        (stone(), config(iterations=60), "20,40", StopReason.ITERATIONS, 40.0),
        (stone(), config(iterations=60, window=(0, 100), step_bound=0, step=0.5), "40", StopReason.ITERATIONS, 40.0),
        (CUBE, config("paper", step=0.1, iterations=200), "50", StopReason.COLLAPSED, 120.0),
        (stone(), config(iterations=300, stop_radius_variation=0.06), "3", StopReason.CONVERGED, 5.0),
    ],
    ids=["iterations", "best in between", "collapsed", "converged"],
)  # fmt: skip
def test_going_on_from_any_kept_state_ends_with_the_same_bytes(
    mesh: TriangleMesh, settings: FlowConfig, plan: str, reason: StopReason, ticks: float
) -> None:
    whole_end, whole = recorded(mesh, settings, plan)
    assert whole_end.stop_reason is reason
    _, often = recorded(mesh, settings, plan, clock=ticking(1.0), checkpoint_s=ticks)
    assert often.snapshots == whole.snapshots  # looking at a clock changes nothing
    assert often.checkpoints
    resumable = [
        (iteration, load_arrays(content))
        for iteration, content in (*whole.snapshots.items(), *often.checkpoints.items())
    ]
    for iteration, arrays in resumable:
        if "best_metrics" not in arrays:
            continue
        end, later = recorded(mesh, settings, plan, resume=arrays)
        assert later.rows == whole.rows
        assert {
            **{i: c for i, c in whole.snapshots.items() if i <= iteration},
            **later.snapshots,
        } == whole.snapshots
        assert (end.stop_reason, end.stop_detail, end.iteration, end.best_iteration) == (
            whole_end.stop_reason,
            whole_end.stop_detail,
            whole_end.iteration,
            whole_end.best_iteration,
        )


@pytest.mark.parametrize("looks", [0, 5, 20, 21])
def test_a_run_that_is_handed_on_again_and_again_ends_with_the_same_bytes(looks: int) -> None:
    settings = config(iterations=50)
    _, whole = recorded(stone(), settings, "20,21,40")
    kept: dict[int, bytes] = {}
    resume = None
    for _ in range(200):
        end, part = recorded(stone(), settings, "20,21,40", resume=resume, stop=stop_at(looks, Stop.HAND_ON))
        kept.update(part.snapshots)
        if end.stop_reason is not None:
            break
        states = {**part.snapshots, **part.checkpoints}
        resume = load_arrays(states[max(states)])
    assert kept == whole.snapshots


def test_a_cancelled_run_keeps_what_it_has_and_can_go_on() -> None:
    settings = config(iterations=120)
    end, sink = recorded(stone(), settings, "40", stop=stop_at(60, Stop.CANCEL))
    assert (end.stop_reason, end.iteration) == (StopReason.CANCELLED, 60)
    assert {0, 40, 60} <= set(sink.snapshots)
    outcome = outcome_of(end)
    assert (outcome.status, outcome.result_iteration, outcome.stop_reason) == (
        JobStatus.CANCELLED,
        None,
        "cancelled",
    )
    _, whole = recorded(stone(), settings, "40")
    _, later = recorded(stone(), settings, "40", resume=load_arrays(sink.snapshots[60]))
    one, other = load_arrays(later.snapshots[120]), load_arrays(whole.snapshots[120])
    rows = [{row["iteration"]: row for row in rows_to_list(arrays.pop(ROWS))} for arrays in (one, other)]
    assert {name: array.tobytes() for name, array in one.items()} == {
        name: array.tobytes() for name, array in other.items()
    }
    assert rows[0] == {**rows[0], **rows[1]}  # and those of the states that the cancelled run was left with


def test_a_deadline_fails_with_the_last_state() -> None:
    end, sink = recorded(stone(), config(iterations=1000), clock=ticking(0.01), deadline_s=1.0)
    assert end.stop_reason is StopReason.DEADLINE
    assert end.iteration in sink.snapshots
    outcome = outcome_of(end)
    assert outcome.status is JobStatus.FAILED
    assert outcome.result_iteration == end.iteration
    assert outcome.error is not None
    assert outcome.error.code == "deadline"
    assert "1 s" in outcome.error.detail


def test_a_deadline_that_was_over_before_the_run_began_says_how_long_it_was() -> None:
    """As after a resumption that took its time."""
    clock = ticking(0.01)
    end, sink = recorded(stone(), config(iterations=1000), clock=clock, deadline_s=60.0, since=clock() - 99.0)
    assert (end.stop_reason, end.iteration) == (StopReason.DEADLINE, 0)
    assert list(sink.snapshots) == [0]
    assert end.stop_detail == "the limit of 60 s, all attempts together, was up after iteration 0"


def test_a_deadline_names_the_limit_and_not_what_was_left_of_it() -> None:
    limits = {"deadline_s": 1600.0, "limit_s": 21600.0}
    clock = ticking(0.01)
    end, _ = recorded(stone(), config(iterations=1000), clock=clock, since=clock() - 1600.0, **limits)
    assert end.stop_detail == "the limit of 21600 s, all attempts together, was up after iteration 0"


def test_a_collapse_fails_with_its_best_state_and_advice() -> None:
    end, sink = recorded(CUBE, config("paper", step=0.1, iterations=200))
    outcome = outcome_of(end)
    assert outcome.status is JobStatus.FAILED
    assert outcome.stop_reason == "collapsed"
    assert outcome.error is not None
    assert outcome.error.code == "collapsed"
    assert "robust" in outcome.error.detail
    assert outcome.result_iteration == outcome.best_iteration == end.iteration
    assert end.iteration in sink.snapshots
    assert max(sink.rows) > end.iteration  # the way into the collapse is recorded
    assert end.progress.iteration >= max(sink.rows)  # and the progress stays where it broke
    assert f"iteration {end.progress.iteration + 1} " in str(end.stop_detail)
    for content in sink.snapshots.values():
        assert np.isfinite(load_arrays(content)["vertices"]).all()


def test_a_run_without_iterations_ends_with_the_mesh_as_it_came() -> None:
    end, sink = recorded(stone(), config(iterations=0))
    assert outcome_of(end).status is JobStatus.SUCCESSFUL
    assert set(sink.snapshots) == set(sink.rows) == {0}
    assert load_arrays(sink.snapshots[0])["vertices"].tobytes() == stone().vertices.tobytes()


def test_progress_is_told_at_most_twice_a_second_and_never_the_end_before_it_is_durable() -> None:
    end, sink = recorded(stone(), config(iterations=150), clock=ticking(0.02))
    told = [progress.elapsed_s for progress in sink.reports]
    assert all(later - earlier >= 0.5 for earlier, later in itertools.pairwise(told[1:]))
    assert len(told) > 3
    assert all(progress.iteration < 150 for progress in sink.reports)
    assert end.progress.iteration == end.progress.iterations_total == 150
    assert end.progress.eta_s == 0


def test_rate_and_time_left_are_those_of_the_last_seconds() -> None:
    _, sink = recorded(stone(), config(iterations=100), clock=ticking(0.25))
    last = sink.reports[-1]
    rate = last.iterations_per_s
    assert rate is not None
    assert last.eta_s == pytest.approx((100 - last.iteration) / rate)
    assert 0.2 < rate < 4  # a few looks at the clock an iteration


def test_a_sink_that_fails_ends_the_run() -> None:
    class Full(Recorder):
        def snapshot(self, kept: Kept) -> None:
            raise OSError(28, "full")

    with pytest.raises(OSError, match="full"):
        run(stone(), config(iterations=5), SnapshotPlan.parse("", 5), Full())


def test_a_run_that_was_handed_on_has_no_outcome() -> None:
    end, _ = recorded(stone(), config(iterations=5), stop=lambda: Stop.HAND_ON)
    with pytest.raises(ValueError, match="not ended"):
        outcome_of(end)


def test_progress_is_never_behind_what_is_kept() -> None:
    def cancelled() -> Stop | None:
        return Stop.HAND_ON if len(sink.reports) > 30 else None

    sink = Recorder()
    plan = SnapshotPlan.parse("every:3", 200)
    end = run(stone(), config(iterations=200), plan, sink, stop=cancelled, clock=ticking(0.01))
    assert end.stop_reason is None
    assert len(sink.snapshots) > 10
    assert not sink.ahead
