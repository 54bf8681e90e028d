"""Small files made to cost much end in a refusal, in the child, within what they are given."""

from __future__ import annotations

import resource
import sys
from pathlib import Path

import pytest

from spherify.formats import MeshRefusedError, ReadLimits, read_mesh
from tests.formats import hostile

GIB = 1 << 30
VERTICES = hostile.zip_bomb(hostile.MODEL_HEAD, hostile.VERTEX, 1024)
COMPONENTS = hostile.zip_bomb(hostile.COMPONENTS_HEAD, hostile.COMPONENT, 400)
BLANKS = hostile.zip_bomb(hostile.MODEL_HEAD, b" ", 1024)
# Name, content, code, and words of the sentence: none where on a busy machine the clock may be the first to strike.
FILES = {
    "3mf-vertices.3mf": (VERTICES, "mesh-too-large", ""),
    "3mf-blanks.3mf": (BLANKS, "mesh-too-large", ""),
    "3mf-components.3mf": (COMPONENTS, "mesh-too-large", "places more than 4,096 parts"),
    "glb-nodes.glb": (hostile.glb_of_nodes(100_000), "mesh-too-large", "more than 65,536 nodes"),
    "glb-points.glb": (hostile.glb_of_points(30_000, 30_000), "mesh-too-large", "more than 4,096 parts"),
    "glb-5e7.glb": (hostile.glb_claiming(50_000_000), "mesh-too-large", "counts 50,000,000 items"),
    "glb-2e8.glb": (hostile.glb_claiming(200_000_000), "mesh-too-large", "counts 200,000,000 items"),
    "glb-primitives.glb": (hostile.glb_of_primitives(50_000), "mesh-too-large", "more than 4,096 parts"),
    "glb-shared.glb": (hostile.glb_sharing(4_000, 1_900_000), "mesh-too-large", "3,800,000 vertices or more"),
    "materials-16k.obj": (hostile.obj_of_materials(16_000), "mesh-not-manifold", "more than two faces"),
    "materials-100k.obj": (hostile.obj_of_materials(100_000), "mesh-not-manifold", "more than two faces"),
    "polygon.obj": (hostile.obj_of_one_polygon(1_000_000), "mesh-not-parsable", "0 units in size"),
    "polygon.ply": (hostile.ply_of_one_polygon(1_000_000), "mesh-not-parsable", "0 units in size"),
    "claims-ascii.ply": (hostile.ply_claiming("ascii", 10**9), "mesh-not-parsable", "claims 1,000,000,000 rows"),
    "claims-binary.ply": (hostile.ply_claiming("binary_big_endian", 4 * 10**9), "mesh-not-parsable", "4,000,000,000"),
    "claims.stl": (bytes(80) + b"\xff" * 4 + bytes(100), "mesh-not-parsable", "claims 4,294,967,295 triangles"),
    "claims.off": (b"OFF\n2000000000 2000000000 0\n", "mesh-not-parsable", "claims 2,000,000,000 vertices"),
}  # fmt: skip


@pytest.mark.parametrize("name", FILES)
def test_it_is_refused_within_its_limits(name: str, tmp_path: Path):
    data, code, words = FILES[name]
    path = tmp_path / name
    path.write_bytes(data)
    limits = ReadLimits()
    assert limits.seconds_for(len(data)) <= 10
    assert limits.memory_for(len(data)) <= 1.5 * GIB
    with pytest.raises(MeshRefusedError) as refusal:
        read_mesh(path, name)
    assert refusal.value.code == code
    assert words in str(refusal.value)


@pytest.mark.skipif(sys.platform == "darwin", reason="macOS does not enforce RLIMIT_AS; the caps above it do")
def test_the_limit_on_memory_holds_where_no_cap_does(tmp_path: Path):
    path = tmp_path / "polygon.ply"
    path.write_bytes(hostile.ply_of_one_polygon(3_000_000))
    tight = ReadLimits(memory_bytes=300 << 20, memory_per_byte=0)
    with pytest.raises(MeshRefusedError, match="more memory than a file of this size is given") as refusal:
        read_mesh(path, path.name, limits=tight)
    assert refusal.value.code == "mesh-too-large"


def test_no_child_so_far_took_more_than_it_may():
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
    assert peak < 1.5 * GIB
