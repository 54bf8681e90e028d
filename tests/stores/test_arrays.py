from __future__ import annotations

import io

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spherify.jobs.errors import DamagedBlobError
from spherify.stores.arrays import dump_arrays, load_arrays

ARRAYS = {
    "vertices": np.arange(12.0).reshape(4, 3) / 7,
    "by columns": np.asfortranarray(np.arange(6).reshape(2, 3)),
    "one": np.array(3),
    "rows": np.array([(1, 0.5), (2, 0.25)], dtype=[("iteration", np.int64), ("sphericity", np.float64)]),
    "none": np.zeros((0, 3)),
}
FILE = dump_arrays(ARRAYS)


def test_what_is_read_is_what_was_written_bit_for_bit() -> None:
    loaded = load_arrays(FILE)
    assert list(loaded) == list(ARRAYS)
    for name, array in ARRAYS.items():
        assert loaded[name].dtype == array.dtype
        assert loaded[name].shape == array.shape
        assert loaded[name].tobytes() == array.tobytes()
        assert not loaded[name].flags.writeable


def test_a_stream_is_read_as_well() -> None:
    assert load_arrays(io.BytesIO(FILE))["one"] == 3


def test_the_same_arrays_are_the_same_bytes() -> None:
    again = {name: array.copy(order="K") for name, array in ARRAYS.items()}
    assert dump_arrays(again) == FILE


def test_how_an_array_lies_in_memory_does_not_matter() -> None:
    again = {**ARRAYS, "vertices": np.asfortranarray(ARRAYS["vertices"])}
    assert dump_arrays(again) == FILE


def test_numpy_reads_the_file_too() -> None:
    with np.load(io.BytesIO(FILE), allow_pickle=False) as loaded:
        assert np.array_equal(loaded["vertices"], ARRAYS["vertices"])


@settings(max_examples=200, deadline=None)
@given(st.integers(0, len(FILE) - 1), st.integers(1, 255))
def test_every_altered_byte_is_noticed(position: int, change: int) -> None:
    damaged = bytearray(FILE)
    damaged[position] ^= change
    with pytest.raises(DamagedBlobError):
        load_arrays(bytes(damaged))


@pytest.mark.parametrize("length", [0, 1, 100, len(FILE) // 2, len(FILE) - 1])
def test_a_file_cut_off_is_damaged(length: int) -> None:
    with pytest.raises(DamagedBlobError):
        load_arrays(FILE[:length])


def test_objects_are_neither_written_nor_read() -> None:
    objects = np.array([{}], dtype=object)
    with pytest.raises(ValueError, match="Object"):
        dump_arrays({"evil": objects})
    file = io.BytesIO()
    np.savez(file, evil=objects, allow_pickle=True)
    with pytest.raises(DamagedBlobError):
        load_arrays(file.getvalue())


def test_a_file_without_a_checksum_is_damaged() -> None:
    file = io.BytesIO()
    np.savez(file, vertices=ARRAYS["vertices"])
    with pytest.raises(DamagedBlobError):
        load_arrays(file.getvalue())
