"""Arrays as VTK's objects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from carom.arrays import Array
from carom.show.film.window import vtk

Colour = tuple[float, float, float]


def colour(css: str) -> Colour:
    """`#rrggbb` as three numbers from 0 to 1."""
    return tuple(int(css[i : i + 2], 16) / 255 for i in (1, 3, 5))  # type: ignore[return-value]


def array(values: Array, name: str = "") -> Any:
    """A VTK array that has its own copy."""
    found = vtk("util.numpy_support").numpy_to_vtk(np.ascontiguousarray(values), deep=True)
    if name:
        found.SetName(name)
    return found


def cells(rows: Array) -> Any:
    """Cells of k corners each, from (n, k) indices."""
    found = vtk("vtkCommonDataModel").vtkCellArray()
    count, k = rows.shape
    offsets = np.arange(0, count * k + 1, k, dtype=np.int64)
    found.SetData(array(offsets), array(rows.astype(np.int64).ravel()))
    return found


def mesh(points: Array, faces: Array | None = None, lines: Array | None = None) -> Any:
    """A vtkPolyData of points (n, 3), faces (F, k) and lines (L, 2)."""
    found = vtk("vtkCommonDataModel").vtkPolyData()
    place(found, points)
    if faces is not None:
        found.SetPolys(cells(faces))
    if lines is not None:
        found.SetLines(cells(lines))
    return found


def place(data: Any, points: Array) -> None:
    """Give a vtkPolyData new points (n, 3)."""
    found = vtk("vtkCommonCore").vtkPoints()
    found.SetData(array(points.astype(np.float32)))
    data.SetPoints(found)


def attach(data: Any, values: Array, name: str) -> None:
    """Give the points of a vtkPolyData an array (n, k)."""
    data.GetPointData().AddArray(array(values.astype(np.float32), name))


def actor(data: Any, look: Colour, *, smooth: bool = False) -> Any:
    """Something of one colour to be drawn; `smooth` lets light run over the edges of what is round."""
    core = vtk("vtkRenderingCore")
    mapper = core.vtkPolyDataMapper()
    if smooth:
        normals = vtk("vtkFiltersCore").vtkPolyDataNormals()
        normals.SetInputData(data)
        normals.ConsistencyOff()
        normals.SplittingOff()
        normals.Update()
        data = normals.GetOutput()
    mapper.SetInputData(data)
    mapper.ScalarVisibilityOff()
    found = core.vtkActor()
    found.SetMapper(mapper)
    found.GetProperty().SetColor(*look)
    return found


def shaded(data: Any, attributes: Sequence[str], vertex: Sequence[str], fragment: Sequence[str]) -> Any:
    """An actor whose colour a program finds: `attributes` are arrays of the points; `vertex` and `fragment` are what to
    declare and what to do, the latter to set `gl_FragData[0]`.
    """
    found = actor(data, (1.0, 1.0, 1.0))
    mapper = found.GetMapper()
    mapper.SetVBOShiftScaleMethod(0)  # the programs compare points with other coordinates
    per_point = vtk("vtkCommonDataModel").vtkDataObject.FIELD_ASSOCIATION_POINTS
    for name in attributes:
        mapper.MapDataArrayToVertexAttribute(name, name, per_point, -1)
    program = found.GetShaderProperty()
    declared, done = "//VTK::PositionVC::Dec", "//VTK::PositionVC::Impl"
    program.AddVertexShaderReplacement(declared, True, f"{declared}\n{vertex[0]}\n", False)
    program.AddVertexShaderReplacement(done, True, f"{done}\n{vertex[1]}\n", False)
    late = "//VTK::Picking::Dec"  # behind VTK's own declarations, as of textures
    program.AddFragmentShaderReplacement(late, True, f"{late}\n{fragment[0]}\n", False)
    light = "//VTK::Light::Impl"
    program.AddFragmentShaderReplacement(light, True, f"{light}\n{fragment[1]}\n", False)
    found.ForceOpaqueOn()  # what is soft at the rim is sorted here already
    return found
