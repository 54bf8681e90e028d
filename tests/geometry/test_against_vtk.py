"""The ``vtk`` measure is what the real vtkCurvatures computes."""

from __future__ import annotations

import numpy as np
import pytest

from spherify.geometry.curvature import vertex_curvature
from spherify.geometry.samples import SAMPLES
from spherify.geometry.topology import Topology
from tests.geometry.shapes import ROUNDING, open_bump, pinched, read_obj, sample, torus, uneven_sphere


def vtk_curvature(mesh):
    from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
    from vtkmodules.vtkFiltersGeneral import vtkCurvatures

    points = vtkPoints()
    points.SetData(numpy_to_vtk(np.ascontiguousarray(mesh.vertices), deep=True))
    cells = vtkCellArray()
    offsets = numpy_to_vtkIdTypeArray(3 * np.arange(len(mesh.faces) + 1), deep=True)
    cells.SetData(offsets, numpy_to_vtkIdTypeArray(mesh.faces.reshape(-1).copy(), deep=True))
    data = vtkPolyData()
    data.SetPoints(points)
    data.SetPolys(cells)
    curvatures = vtkCurvatures()
    curvatures.SetInputData(data)
    curvatures.SetCurvatureTypeToMean()
    curvatures.Update()
    return vtk_to_numpy(curvatures.GetOutput().GetPointData().GetArray("Mean_Curvature")).copy()


def assert_agrees(mesh):
    expected = vtk_curvature(mesh)
    actual = vertex_curvature(mesh.vertices, Topology.of(len(mesh.vertices), mesh.faces), "vtk")
    np.testing.assert_allclose(actual, expected, rtol=0, atol=ROUNDING * np.abs(expected).max())


@pytest.mark.parametrize("name", SAMPLES)
def test_on_the_samples(name):
    assert_agrees(sample(name, 1000))


@pytest.mark.parametrize(
    "mesh", [uneven_sphere(8), torus(), pinched(), open_bump()], ids=["sphere", "torus", "pinched", "open"]
)
def test_on_other_topologies(mesh):
    assert_agrees(mesh)


@pytest.mark.parametrize("name", ["spot.obj", "castalia.obj", "216Kleopatra.obj", "bad/genus1_kitten.obj"])
def test_on_real_meshes(name):
    assert_agrees(read_obj(name))
