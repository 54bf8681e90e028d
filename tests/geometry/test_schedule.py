"""The staged schedule, snapshot plans, and the rows of the time series."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from spherify.geometry.config import Stage
from spherify.geometry.errors import InvalidConfigError
from spherify.geometry.presets import ALGORITHM_2
from spherify.geometry.schedule import (
    FIRST_ROWS,
    LEAST_STRIDE,
    MAX_SNAPSHOTS,
    ROWS_AFTERWARDS,
    SnapshotPlan,
    is_recorded,
    recorded_iterations,
    stage_at,
)

LENGTHS = st.integers(0, 200_000)


def test_algorithm_2_of_the_paper():
    first, second = ALGORITHM_2
    at = {0: first, 99: first, 100: second, 199: second, 200: first, 399: second, 10_000: first}
    assert {i: stage_at(ALGORITHM_2, i) for i in at} == at


@given(
    st.lists(
        st.builds(Stage, st.integers(1, 5), st.integers(0, 3), st.integers(1, 3)), min_size=1, max_size=4
    )
)
def test_a_schedule_is_cycled(stages):
    unrolled = [stage for stage in stages for _ in range(stage.repeat)]
    for i in range(3 * len(unrolled)):
        assert stage_at(stages, i) == unrolled[i % len(unrolled)]


@pytest.mark.parametrize(
    ("plan", "iterations", "expected"),
    [
        ("100,500,1000", 5000, (0, 100, 500, 1000, 5000)),
        ("  7 ; 3 3,5 ", 10, (0, 3, 5, 7, 10)),
        ([3, 1], 3, (0, 1, 3)),
        ("", 9, (0, 9)),
        ([], 0, (0,)),
        ("every:100", 350, (0, 100, 200, 300, 350)),
        ("every : 400", 350, (0, 350)),
        ("log:4", 1000, (0, 1, 10, 100, 1000)),
        ("log:1", 1000, (0, 1000)),
        ("log:50", 3, (0, 1, 2, 3)),
        ("log:3", 0, (0,)),
    ],
)
def test_plans(plan, iterations, expected):
    assert SnapshotPlan.parse(plan, iterations).iterations == expected


@pytest.mark.parametrize(
    ("plan", "iterations", "sentence"),
    [
        (
            "often",
            10,
            "'often' is no plan of snapshots: write snapshots as a list like 100,500,1000, or every:N, or log:N",
        ),
        ("-5", 10, "is no plan"),
        ("1.5", 10, "is no plan"),
        ("every:0", 10, "every:0 keeps nothing"),
        ("log:0", 10, "log:0 keeps nothing"),
        ("every:1", 5000, "every:1 keeps 5001 snapshots and at most 1000 are kept: every:6 is the densest"),
        ("log:2000", 500_000, "at most 1000"),
        ("11", 10, "snapshot 11 lies outside 0 … 10"),
        ([-1], 10, "snapshot -1 lies outside"),
        ([1.5], 10, "1.5 is no iteration"),
        ([True], 10, "True is no iteration"),
        (list(range(1, 1001)), 2000, "keeps 1002 snapshots"),
    ],
)
def test_plans_that_are_refused(plan, iterations, sentence):
    with pytest.raises(InvalidConfigError, match=sentence.replace("(", r"\(")):
        SnapshotPlan.parse(plan, iterations)


@given(LENGTHS, st.data())
def test_a_list_keeps_what_it_names_and_the_ends(iterations, data):
    named = data.draw(st.lists(st.integers(0, iterations), max_size=50))
    plan = SnapshotPlan.parse(named, iterations)
    assert plan == SnapshotPlan.parse(",".join(map(str, named)), iterations)
    assert set(plan.iterations) == {0, iterations, *named}
    assert list(plan.iterations) == sorted(set(plan.iterations))


@given(LENGTHS, st.integers(1, 300_000))
def test_every_is_evenly_spaced_or_says_what_would_be(iterations, stride):
    try:
        plan = SnapshotPlan.parse(f"every:{stride}", iterations)
    except InvalidConfigError as refused:
        densest = str(refused).split("every:")[-1].split()[0]
        assert int(densest) > stride
        plan = SnapshotPlan.parse(f"every:{densest}", iterations)
        stride = int(densest)
        with pytest.raises(InvalidConfigError, match="densest"):
            SnapshotPlan.parse(f"every:{stride - 1}", iterations)
    assert len(plan.iterations) <= MAX_SNAPSHOTS
    assert all(i % stride == 0 for i in plan.iterations[:-1])
    assert len(plan.iterations) >= iterations // stride


@given(LENGTHS, st.integers(1, MAX_SNAPSHOTS - 2))
def test_log_spreads_out(iterations, count):
    kept = SnapshotPlan.parse(f"log:{count}", iterations).iterations
    assert kept[0] == 0
    assert kept[-1] == iterations
    assert len(kept) <= count + 1
    gaps = [b - a for a, b in itertools.pairwise(kept)]
    assert all(later >= earlier - 1 for earlier, later in itertools.pairwise(gaps))


@given(st.integers(0, 20_000), st.data())
def test_rows_follow_from_the_numbers_alone(iterations, data):
    plan = SnapshotPlan.parse(data.draw(st.lists(st.integers(0, iterations), max_size=5)), iterations)
    rows = recorded_iterations(iterations, plan)
    assert list(rows) == [i for i in range(iterations + 1) if is_recorded(i, iterations, plan)]
    assert set(plan.iterations) <= set(rows)
    assert len(rows) <= len(FIRST_ROWS) + ROWS_AFTERWARDS + len(plan.iterations) + 2


def test_rows_are_dense_at_first_and_never_far_apart():
    rows = recorded_iterations(400, SnapshotPlan.parse("", 400))
    gaps = [b - a for a, b in itertools.pairwise(rows)]
    assert rows[:11] == tuple(range(11))
    assert max(gaps) == LEAST_STRIDE
    assert len(rows) <= 400 * 0.1  # of a fifth of an iteration each: 2 % of the run


def test_a_plan_knows_its_iterations():
    plan = SnapshotPlan.parse("5", 10)
    assert 5 in plan
    assert 6 not in plan
