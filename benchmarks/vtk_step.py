"""One elementary step as the paper's author wrote it: curvature by vtkCurvatures, the rest in numpy."""

from __future__ import annotations

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkFiltersGeneral import vtkCurvatures

from spherify.geometry import measures
from spherify.geometry.mesh import Floats, TriangleMesh


class VtkStep:
    """I_C and O_C on one connectivity; vtkCurvatures is given the same vtkPolyData every time, with new points."""

    def __init__(self, mesh: TriangleMesh) -> None:
        self._faces = np.asfortranarray(mesh.faces)
        cells = vtkCellArray()
        offsets = numpy_to_vtkIdTypeArray(3 * np.arange(len(mesh.faces) + 1), deep=True)
        cells.SetData(offsets, numpy_to_vtkIdTypeArray(mesh.faces.reshape(-1).copy(), deep=True))
        self._data = vtkPolyData()
        self._data.SetPolys(cells)
        self._points = vtkPoints()
        self._data.SetPoints(self._points)
        self._curvatures = vtkCurvatures()
        self._curvatures.SetInputData(self._data)
        self._curvatures.SetCurvatureTypeToMean()

    def __call__(self, V: Floats, step: float, *, outward: bool) -> Floats:
        """Return positions (n, 3) after one elementary step of length ``step``."""
        self._points.SetData(numpy_to_vtk(np.ascontiguousarray(V), deep=True))
        self._data.Modified()
        self._curvatures.Update()
        K = vtk_to_numpy(self._curvatures.GetOutput().GetPointData().GetArray("Mean_Curvature"))
        t = (K - K.min()) / (K.max() - K.min())
        normals = measures.vertex_normals(measures.face_normals(V, self._faces), self._faces, len(V))
        return V + step * ((1 - t) if outward else -t)[:, None] * normals
