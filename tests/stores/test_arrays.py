from __future__ import annotations

import hashlib
import io

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spherify.jobs.errors import DamagedBlobError
from spherify.stores.arrays import checksum_of, dump_arrays, glance_at_arrays, load_arrays

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


def test_a_glance_reads_what_is_wanted_and_where_the_rest_is() -> None:
    class Counting(io.BytesIO):
        total = 0

        def read(self, size: int | None = -1) -> bytes:
            content = super().read(size)
            self.total += len(content)
            return content

    large = dump_arrays({"vertices": np.zeros((100_000, 3)), "one": np.array(3)})
    file = Counting(large)
    checksum, names, found = glance_at_arrays(file, ("one", "none of it"))
    assert checksum == checksum_of(large)
    assert names == {"vertices", "one"}
    assert {name: array.tolist() for name, array in found.items()} == {"one": 3}
    assert file.total < len(large) / 10


@given(st.integers(0, len(FILE) - 1), st.integers(1, 40))
def test_a_glance_at_a_file_with_a_hole_or_an_end_too_early_says_so(start: int, length: int) -> None:
    for damaged in (FILE[:start], FILE[:start] + FILE[start + length :]):
        with pytest.raises(DamagedBlobError):
            glance_at_arrays(io.BytesIO(damaged), ())


def test_what_has_a_checksum_and_is_no_file_of_arrays_is_called_damaged() -> None:
    for content in (b"", b"PK\x05\x06", b"something else"):
        whole = content + hashlib.sha256(content).hexdigest().encode()
        with pytest.raises(DamagedBlobError):
            load_arrays(whole)
        with pytest.raises(DamagedBlobError):
            glance_at_arrays(io.BytesIO(whole), ())
