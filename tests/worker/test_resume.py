from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest

from spherify.geometry.schedule import SnapshotPlan
from spherify.jobs import layout
from spherify.jobs.ports import Trail
from spherify.jobs.rows import ROWS, rows_to_array, rows_to_list
from spherify.jobs.run import Kept, Stop, run
from spherify.parameters import resolve
from spherify.stores.arrays import dump_arrays, load_arrays
from spherify.stores.blobs import FolderBlobStore
from spherify.stores.states import find_trail
from tests.jobs.examples import stone
from tests.jobs.test_run import Recorder, stop_at
from worker.orders import Order
from worker.resume import find_resumption
from worker.runner import PipeSink

PLAN = SnapshotPlan((0, 10, 20, 30))
JOB = "job_a"


@pytest.fixture
def blobs(tmp_path: Path) -> FolderBlobStore:
    """The files of a first attempt that was handed on after 24 iterations."""
    blobs = FolderBlobStore(tmp_path)

    class Files(Recorder):
        def snapshot(self, kept: Kept) -> None:
            blobs.create(layout.numbered(layout.snapshots(JOB), 1, kept.iteration), dump_arrays(kept.arrays))

        def checkpoint(self, kept: Kept) -> None:
            blobs.create(
                layout.numbered(layout.checkpoints(JOB), 1, kept.iteration), dump_arrays(kept.arrays)
            )

    config = resolve("robust", {"iterations": 30}).config()
    run(stone(), config, PLAN, Files(), stop=stop_at(24, Stop.HAND_ON))
    return blobs


def damage(blobs: FolderBlobStore, key: str, how: str) -> None:
    path = blobs.root / key
    content = bytearray(path.read_bytes())
    if how == "flipped":
        content[len(content) // 2] ^= 1
    else:
        del content[len(content) // 2 :]
    path.write_bytes(content)


def iterations(blobs: FolderBlobStore, *foreign: bytes) -> tuple[int | None, list[int]]:
    """Return where to go on, and the snapshots that are taken over."""
    found = find_resumption(blobs, JOB, PLAN, foreign)
    at = None if found.arrays is None else int(found.arrays["counts"][0])
    return at, [snapshot.iteration for snapshot in found.snapshots]


def test_nothing_to_go_on_from(tmp_path: Path) -> None:
    assert iterations(FolderBlobStore(tmp_path)) == (None, [])


def test_the_newest_state_is_taken(blobs: FolderBlobStore) -> None:
    assert iterations(blobs) == (24, [0, 10, 20])


@pytest.mark.parametrize("how", ["flipped", "cut off"])
def test_a_damaged_checkpoint_is_passed_over(blobs: FolderBlobStore, how: str) -> None:
    damage(blobs, layout.numbered(layout.checkpoints(JOB), 1, 24), how)
    assert iterations(blobs) == (20, [0, 10, 20])


def test_where_the_newest_checkpoint_is_damaged_the_one_before_is_taken(blobs: FolderBlobStore) -> None:
    folder = layout.checkpoints(JOB)
    content = load_arrays(blobs.read(layout.numbered(folder, 1, 24)))
    order = Order(JOB, 1, str(blobs.root), memory_bytes=1, deadline_s=1, limit_s=1, checkpoint_s=1)
    sink = PipeSink(blobs, order, io.BytesIO())
    for iteration in (26, 28):
        counts = content["counts"].copy()
        counts[0] = iteration
        sink.checkpoint(Kept(iteration, {**content, "counts": counts}, {}))
    damage(blobs, layout.numbered(folder, 1, 28), "flipped")
    assert iterations(blobs) == (26, [0, 10, 20])


@pytest.mark.parametrize("how", ["flipped", "cut off"])
def test_a_damaged_snapshot_is_computed_again(blobs: FolderBlobStore, how: str) -> None:
    damage(blobs, layout.numbered(layout.snapshots(JOB), 1, 10), how)
    assert iterations(blobs) == (0, [0])


@pytest.mark.parametrize("rows", [None, 2], ids=["without rows", "without its own row"])
def test_a_snapshot_of_another_form_is_computed_again(blobs: FolderBlobStore, rows: int | None) -> None:
    path = blobs.root / layout.numbered(layout.snapshots(JOB), 1, 10)
    arrays = dict(load_arrays(path.read_bytes()))
    if rows is None:
        del arrays[ROWS]
    else:
        arrays[ROWS] = arrays[ROWS][:rows]
    path.write_bytes(dump_arrays(arrays))
    assert iterations(blobs) == (0, [0])


def test_a_checkpoint_swept_by_a_runner_that_still_lives_is_passed_over(blobs: FolderBlobStore) -> None:
    class Swept(FolderBlobStore):
        def read(self, key: str) -> bytes:
            if key.startswith(layout.checkpoints(JOB)):
                self.delete(key)
            return super().read(key)

    assert iterations(Swept(blobs.root)) == (20, [0, 10, 20])


def test_a_checkpoint_replaces_the_earlier_ones_but_one_and_not_those_of_a_later_attempt(
    blobs: FolderBlobStore,
) -> None:
    folder = layout.checkpoints(JOB)
    later = layout.numbered(folder, 3, 12)
    older = [
        layout.numbered(folder, 1, iteration) for iteration in (9_999_999, 10_000_000)
    ]  # by number, not by name
    for key in (later, *older):
        blobs.create(key, b"")
    order = Order(JOB, 2, str(blobs.root), memory_bytes=1, deadline_s=1, limit_s=1, checkpoint_s=1)
    PipeSink(blobs, order, io.BytesIO()).checkpoint(Kept(22, {"vertices": stone().vertices}, {}))
    assert {stat.key for stat in blobs.list(folder)} == {older[-1], layout.numbered(folder, 2, 22), later}


def test_states_of_a_run_that_nobody_can_go_on_with_count_as_if_they_had_never_been_written(
    blobs: FolderBlobStore,
) -> None:
    """An earlier version came to 24, and a later one, beginning anew, to 12; its own file of 0 is damaged."""
    folders = (layout.snapshots(JOB), layout.checkpoints(JOB))
    found = {stat.key: load_arrays(blobs.read(stat.key)) for folder in folders for stat in blobs.list(folder)}
    state = found[layout.numbered(folders[0], 1, 10)]
    older = (state["fingerprint"] + 1).astype(state["fingerprint"].dtype)
    for key, arrays in found.items():
        Path(blobs.root, key).write_bytes(dump_arrays({**arrays, "fingerprint": older}))
    assert iterations(blobs, older.tobytes()) == (None, [])
    for iteration in (0, 10):
        key = layout.numbered(folders[0], 1, iteration)
        blobs.create(layout.numbered(folders[0], 2, iteration), dump_arrays(found[key]))
    counts = state["counts"].copy()
    counts[0] = 12
    blobs.create(layout.numbered(folders[1], 2, 12), dump_arrays({**state, "counts": counts}))
    assert iterations(blobs, older.tobytes()) == (12, [0, 10])
    assert iterations(blobs) == (24, [0, 10, 20]), "as long as nobody has tried"
    damage(blobs, layout.numbered(folders[0], 2, 0), "flipped")
    assert iterations(blobs, older.tobytes()) == (None, []), "one of the other run does not stand in for it"


def test_another_attempts_copy_stands_in_for_a_damaged_one(blobs: FolderBlobStore) -> None:
    key = layout.numbered(layout.snapshots(JOB), 1, 10)
    blobs.create(layout.numbered(layout.snapshots(JOB), 2, 10), blobs.read(key))
    damage(blobs, layout.numbered(layout.snapshots(JOB), 2, 10), "flipped")
    assert iterations(blobs) == (24, [0, 10, 20])


def test_the_record_of_a_snapshot_is_that_of_its_file(blobs: FolderBlobStore) -> None:
    for snapshot in find_resumption(blobs, JOB, PLAN).snapshots:
        stat = blobs.stat(snapshot.key)
        assert stat is not None
        assert (snapshot.size, snapshot.created_at) == (stat.size, stat.created_at)
        assert set(snapshot.metrics) >= {"sphericity", "area", "inward_faces"}
        assert "iteration" not in snapshot.metrics


def test_what_is_told_of_a_job_without_a_record_is_what_its_files_hold(blobs: FolderBlobStore) -> None:
    trail = find_trail(blobs, JOB)
    assert trail.snapshots == find_resumption(blobs, JOB, PLAN).snapshots
    assert [snapshot.iteration for snapshot in trail.snapshots] == [0, 10, 20]
    assert list(trail.rows) == find_resumption(blobs, JOB, PLAN).rows
    assert trail.best == 20
    assert find_trail(blobs, "job_b") == Trail()


def test_no_positions_are_read_to_tell_what_is_there(blobs: FolderBlobStore) -> None:
    class Grudging(FolderBlobStore):
        def read(self, key: str) -> bytes:
            raise AssertionError(f"{key} is read whole")

    asked: list[int] = []
    expected = find_trail(blobs, JOB)
    assert find_trail(Grudging(blobs.root), JOB, lambda: asked.append(1)) == expected
    assert len(asked) >= 5, (
        "once a file, for the lease on the post of the reconciler may be over before the last"
    )
    path = blobs.root / layout.numbered(layout.snapshots(JOB), 1, 10)
    content = bytearray(path.read_bytes())
    content[200] ^= 1  # a position: whoever serves it, or goes on from it, will see
    path.write_bytes(content)
    assert [snapshot.sha256 for snapshot in find_trail(blobs, JOB).snapshots] == [
        snapshot.sha256 for snapshot in expected.snapshots
    ]
    assert iterations(blobs) == (0, [0])


@pytest.mark.parametrize("how", ["cut off", "of another form", "with other rows", "with rows of other names"])
def test_a_file_that_is_none_of_ours_is_not_in_the_way_of_the_others(
    blobs: FolderBlobStore, how: str
) -> None:
    """Of a snapshot everything is lost that cannot be read of it, and nothing else: what can be served is."""
    path = blobs.root / layout.numbered(layout.snapshots(JOB), 1, 10)
    whole = load_arrays(path.read_bytes())
    if how == "cut off":
        damage(blobs, layout.numbered(layout.snapshots(JOB), 1, 10), how)
    elif how == "of another form":
        path.write_bytes(b"PK" + 64 * b"0")
    else:
        rows = np.zeros(3) if how == "with other rows" else rows_to_array([{"sphericity": 0.5}])
        path.write_bytes(dump_arrays({**whole, ROWS: rows}))
        newest = layout.numbered(layout.checkpoints(JOB), 1, 24)
        (blobs.root / newest).write_bytes(dump_arrays({**load_arrays(blobs.read(newest)), ROWS: rows}))
    for name in ("notes.txt", ".DS_Store", "0000001-0000010.npz~"):
        (blobs.root / layout.snapshots(JOB) / name).write_bytes(b"somebody else's")
    trail = find_trail(blobs, JOB)
    served = [0, 20] if how in {"cut off", "of another form"} else [0, 10, 20]
    assert [snapshot.iteration for snapshot in trail.snapshots] == served
    assert trail.rows[-1]["iteration"] == 20
    assert trail.best == 20
    assert iterations(blobs)[1] == [0]


def test_of_two_runs_only_the_newest_is_told(blobs: FolderBlobStore) -> None:
    first = load_arrays(blobs.read(layout.numbered(layout.snapshots(JOB), 1, 0)))
    began_anew = layout.numbered(layout.snapshots(JOB), 2, 0)
    blobs.create(began_anew, dump_arrays({**first, "fingerprint": first["fingerprint"] ^ 1}))
    trail = find_trail(blobs, JOB)
    assert [snapshot.key for snapshot in trail.snapshots] == [began_anew]
    assert [row["iteration"] for row in trail.rows] == [0]


@pytest.mark.parametrize("token", [1, 2])
def test_a_best_state_kept_in_hindsight_is_told_with_the_others(blobs: FolderBlobStore, token: int) -> None:
    """It carries no state of the flow, and a worker may be lost after it, before the last one is kept."""
    last = load_arrays(blobs.read(layout.numbered(layout.checkpoints(JOB), 1, 24)))
    best = layout.numbered(layout.snapshots(JOB), token, 26)
    rows = [*rows_to_list(last[ROWS]), {**rows_to_list(last[ROWS])[-1], "iteration": 26, "sphericity": 0.999}]
    blobs.create(best, dump_arrays({"vertices": last["vertices"], ROWS: rows_to_array(rows)}))
    trail = find_trail(blobs, JOB)
    assert [snapshot.iteration for snapshot in trail.snapshots] == [0, 10, 20, 26]
    assert trail.best == 26


def test_where_two_attempts_left_the_same_state_an_intact_one_is_told(blobs: FolderBlobStore) -> None:
    first, again = (layout.numbered(layout.snapshots(JOB), token, 10) for token in (1, 2))
    blobs.copy(first, again)
    assert [snapshot.key for snapshot in find_trail(blobs, JOB).snapshots][1] == again
    (blobs.root / again).unlink()
    content = bytearray(blobs.read(first))
    content[200] ^= 1
    blobs.create(again, bytes(content))
    assert [snapshot.key for snapshot in find_trail(blobs, JOB).snapshots][1] == first
