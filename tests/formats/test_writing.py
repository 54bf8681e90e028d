from __future__ import annotations

import hashlib
import io
import json
import os
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOGeometry import vtkGLTFReader, vtkSTLReader

from spherify.formats import FORMATS_OUT, InvalidExportError, read_mesh, write_mesh
from spherify.formats.acceptance import read
from spherify.formats.readers.stl import TRIANGLE
from spherify.geometry.mesh import TriangleMesh
from tests.formats.shapes import CUBE_FACES, LIMITS, cube, tube

ROOT = Path(__file__).resolve().parents[2]
EXACT = [("obj", False), ("off", False), ("ply", False), ("ply", True)]
FORMS = [*EXACT, ("stl", False), ("stl", True), ("glb", False)]
coordinates = st.floats(-1e100, 1e100, allow_subnormal=True)


@settings(max_examples=40, deadline=None)
@pytest.mark.parametrize(("mesh_format", "ascii_"), EXACT)
@given(vertices=arrays(np.float64, (8, 3), elements=coordinates))
def test_double_precision_reads_back_bit_for_bit(mesh_format: str, ascii_: bool, vertices: np.ndarray):
    mesh = TriangleMesh.checked(vertices, CUBE_FACES)
    raw = read(write_mesh(mesh, mesh_format, ascii=ascii_), mesh_format, LIMITS)
    assert raw.vertices.tobytes() == mesh.vertices.tobytes()
    assert np.array_equal(raw.faces, mesh.faces)


@settings(max_examples=40, deadline=None)
@pytest.mark.parametrize(("mesh_format", "ascii_"), FORMS)
@given(vertices=arrays(np.float64, (8, 3), elements=st.floats(-1e30, 1e30)))
def test_single_precision_reads_back_as_the_nearest_float32(
    mesh_format: str, ascii_: bool, vertices: np.ndarray
):
    mesh = TriangleMesh.checked(vertices, CUBE_FACES)
    raw = read(write_mesh(mesh, mesh_format, precision="float", ascii=ascii_), mesh_format, LIMITS)
    rounded = vertices.astype(np.float32)
    assert np.array_equal(raw.vertices[raw.faces].astype(np.float32), rounded[CUBE_FACES])


@pytest.mark.parametrize(("mesh_format", "ascii_"), FORMS)
def test_what_is_written_comes_back_through_the_front_door(mesh_format: str, ascii_: bool, tmp_path: Path):
    path = tmp_path / "upload"
    path.write_bytes(write_mesh(cube(), mesh_format, ascii=ascii_))
    back = read_mesh(path, f"cube.{mesh_format}")
    assert back.report.format == mesh_format
    if mesh_format == "stl":
        assert (back.report.vertices, back.report.faces, back.report.volume) == (8, 12, 1.0)
    else:
        assert np.array_equal(back.mesh.vertices, cube().vertices)
        assert np.array_equal(back.mesh.faces, cube().faces)
        assert back.report.repairs == ()


@pytest.mark.parametrize(("mesh_format", "ascii_"), FORMS)
def test_the_bytes_are_the_same_every_time(mesh_format: str, ascii_: bool):
    mesh = TriangleMesh.checked(*tube(30, 40, torus=True))
    again = TriangleMesh.checked(mesh.vertices.copy(), mesh.faces.copy())
    assert write_mesh(mesh, mesh_format, ascii=ascii_) == write_mesh(again, mesh_format, ascii=ascii_)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # trimesh's own
def test_the_bytes_of_glb_do_not_hang_on_the_process():
    """Trimesh looks its buffers up by hashes, which Python seeds anew for each process."""
    program = (
        "import hashlib; from spherify.formats import write_mesh; from tests.formats.shapes import cube;"
        "print(hashlib.sha256(write_mesh(cube(), 'glb')).hexdigest(), end='')"
    )
    digests = {
        subprocess.run(
            [sys.executable, "-c", program],
            cwd=ROOT, env=os.environ | {"PYTHONHASHSEED": seed}, check=True, capture_output=True, text=True,
        ).stdout
        for seed in ("1", "2")
    }  # fmt: skip
    assert digests == {hashlib.sha256(write_mesh(cube(), "glb")).hexdigest()}


@pytest.mark.parametrize(("mesh_format", "ascii_"), [("stl", False), ("stl", True), ("glb", False)])
def test_vtk_reads_the_same(mesh_format: str, ascii_: bool, tmp_path: Path):
    """A second opinion, as trimesh writes GLB itself."""
    mesh = TriangleMesh.checked(*tube(7, 9, torus=True))
    path = tmp_path / f"torus.{mesh_format}"
    path.write_bytes(write_mesh(mesh, mesh_format, ascii=ascii_))
    reader = vtkGLTFReader() if mesh_format == "glb" else vtkSTLReader(merging=False)
    reader.SetFileName(str(path))
    reader.Update()
    output = reader.GetOutput()
    if mesh_format == "glb":
        parts = output.NewIterator()
        output = parts.GetCurrentDataObject()
    points = vtk_to_numpy(output.GetPoints().GetData())
    corners = vtk_to_numpy(output.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    assert np.array_equal(points[corners], mesh.vertices.astype(np.float32)[mesh.faces])
    if mesh_format == "glb":
        assert np.array_equal(corners, mesh.faces)


@pytest.mark.parametrize(("mesh_format", "ascii_"), FORMS)
def test_another_library_reads_the_same(mesh_format: str, ascii_: bool):
    mesh = TriangleMesh.checked(*tube(7, 9, torus=True))
    loaded = trimesh.load_mesh(
        io.BytesIO(write_mesh(mesh, mesh_format, ascii=ascii_)), mesh_format, process=False
    )
    np.testing.assert_allclose(loaded.triangles, mesh.vertices[mesh.faces], rtol=0, atol=1e-6)
    if mesh_format != "stl":
        assert np.array_equal(loaded.faces, mesh.faces)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # trimesh's own
@pytest.mark.parametrize("mesh_format", ["obj", "ply", "stl", "stl_ascii", "off", "glb", "3mf"])
def test_what_another_library_writes_is_read(mesh_format: str):
    vertices, faces = tube(7, 9, torus=True)
    written = trimesh.Trimesh(vertices, faces, process=False).export(file_type=mesh_format)
    data = written.encode() if isinstance(written, str) else written
    raw = read(data, mesh_format.partition("_")[0], LIMITS)
    np.testing.assert_allclose(raw.vertices[raw.faces], vertices[faces], rtol=0, atol=1e-6)


def test_numbers_of_text_are_as_short_as_can_be():
    mesh = TriangleMesh.checked([[0.1, 1 / 3, -1e-7], [1, 2, 3], [4, 5, 6]], [[0, 1, 2]])
    assert write_mesh(mesh, "obj").splitlines()[0] == b"v 0.1 0.3333333333333333 -1e-07"
    assert (
        write_mesh(mesh, "obj", precision="float").splitlines()[0]
        == b"v 0.100000001 0.333333343 -1.00000001e-07"
    )


def test_binary_stl_has_unit_normals_and_zero_where_there_is_no_area():
    mesh = TriangleMesh.checked([[0, 0, 0], [2, 0, 0], [0, 2, 0], [4, 0, 0]], [[0, 1, 2], [0, 1, 3]])
    data = write_mesh(mesh, "stl")
    assert struct.unpack_from("<3f", data, 84) == (0, 0, 1)
    assert struct.unpack_from("<3f", data, 134) == (0, 0, 0)
    assert not data.startswith(b"solid")


@pytest.mark.parametrize("scale", [1e-9, 1e-6, 1, 1e6])
def test_stl_has_unit_normals_whatever_the_unit_of_length(scale: float):
    triangles = np.frombuffer(
        write_mesh(TriangleMesh.checked(cube().vertices * scale, CUBE_FACES), "stl"), TRIANGLE, offset=84
    )
    assert np.array_equal(np.abs(triangles["normal"]).sum(axis=1), np.ones(12))


def test_glb_states_the_bounds_of_what_it_holds():
    mesh = TriangleMesh.checked(*tube(7, 9, torus=True))
    data = write_mesh(mesh, "glb")
    magic, version, total, length, kind = struct.unpack_from("<4sIII4s", data)
    assert (magic, version, total, kind) == (b"glTF", 2, len(data), b"JSON")
    assert length % 4 == 0
    description = json.loads(data[20 : 20 + length])
    primitive = description["meshes"][0]["primitives"][0]
    positions = description["accessors"][primitive["attributes"]["POSITION"]]
    stored = mesh.vertices.astype(np.float32)
    assert np.array_equal(np.float32(positions["min"]), stored.min(axis=0))
    assert np.array_equal(np.float32(positions["max"]), stored.max(axis=0))


def test_more_rows_than_one_block_are_all_written():
    points = np.random.default_rng(2).random((70_000, 3))
    faces = np.arange(69_999).reshape(-1, 3)
    raw = read(write_mesh(TriangleMesh.checked(points, faces), "obj"), "obj", LIMITS)
    assert np.array_equal(raw.vertices, points)
    assert np.array_equal(raw.faces, faces)


def test_what_cannot_be_written_is_said():
    with pytest.raises(InvalidExportError, match=", ".join(FORMATS_OUT)):
        write_mesh(cube(), "3mf")
    with pytest.raises(InvalidExportError, match="glb has no text form"):
        write_mesh(cube(), "glb", ascii=True)
    with pytest.raises(InvalidExportError, match="double, float"):
        write_mesh(cube(), "obj", precision="half")  # type: ignore[arg-type]  # on purpose
