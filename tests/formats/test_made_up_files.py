"""Ten thousand files made up by a machine: each is read or refused in our words, and none brings the reader down."""

from __future__ import annotations

import random
from collections import Counter
from contextlib import suppress

import pytest

from spherify.formats import MeshRefusedError, write_mesh
from spherify.formats.acceptance import accept
from spherify.formats.errors import UnreadableError
from spherify.geometry.samples import SAMPLES
from tests.formats.shapes import LIMITS
from tests.formats.test_3mf import model, package

FILES = 1_700  # of each kind
WORDS = (b"0", b"-1", b"9" * 12, b"nan", b"\n", b" ", b"1e999", b"\x00", b"\xff" * 4, b"face 1\n", b"<", b"'")


def altered(content: bytes, rng: random.Random) -> bytes:
    """Flip, replace, insert, cut out or cut off in some places, half of them where heads are."""
    data = bytearray(content)
    for _ in range(rng.choice((1, 1, 2, 4, 16))):
        at = rng.randrange(max(1, len(data) if rng.random() < 0.5 else min(len(data), 200)))
        match rng.randrange(5):
            case 0 if data:
                data[at] ^= 1 << rng.randrange(8)
            case 1 if data:
                data[at] = rng.randrange(256)
            case 2:
                del data[at : at + rng.randrange(1, 20)]
            case 3:
                data[at:at] = rng.choice(WORDS)
            case _:
                del data[at + rng.randrange(1000) :]
    return bytes(data)


@pytest.mark.parametrize("kind", ["obj", "ply", "stl", "off", "glb", "3mf"])
def test_whatever_is_in_it_a_file_is_read_or_refused(kind: str) -> None:
    rng = random.Random(f"files of {kind}")
    good = package() if kind == "3mf" else write_mesh(SAMPLES["stone"].build(20), kind)
    ends: Counter[str] = Counter()
    for number in range(FILES):
        made_up = altered(good, rng)
        if kind == "3mf" and number % 2:  # and what is within the archive
            made_up = package(altered(model().encode(), rng).decode("latin-1"))
        with suppress(UnreadableError, MeshRefusedError):
            accept(made_up, f"made-up.{kind}", (), LIMITS)
            ends["read"] += 1
    assert 0 < ends["read"] < FILES / 2, "both ends are tried"
