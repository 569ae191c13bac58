"""What VTK's own readers find in files for ParaView; tests that call it are skipped where VTK is not installed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest


def steps_of(path: Path) -> list[tuple[float, Any]]:
    """All steps of a VTKHDF or PVD file as (time, vtkPolyData), by VTK's own readers."""
    vtk = pytest.importorskip("vtkmodules.vtkIOHDF", reason="the package vtk is not installed")
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
    from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

    if path.suffix == ".pvd":
        import xml.etree.ElementTree as ElementTree

        found = []
        for entry in ElementTree.parse(path).getroot().iter("DataSet"):
            reader = vtkXMLPolyDataReader()
            reader.SetFileName(str(path.parent / entry.attrib["file"]))
            reader.Update()
            found.append((float(entry.attrib["timestep"]), reader.GetOutput()))
        return found
    reader = vtk.vtkHDFReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    times = reader.GetOutputInformation(0).Get(vtkStreamingDemandDrivenPipeline.TIME_STEPS())
    found = []
    for k, time in enumerate(times):
        reader.SetStep(k)
        reader.Update()
        data = type(reader.GetOutput())()
        data.DeepCopy(reader.GetOutput())
        found.append((time, data))
    return found


def arrays(data: Any) -> dict[str, np.ndarray]:
    from vtkmodules.util.numpy_support import vtk_to_numpy

    points = data.GetPointData()
    named = {
        points.GetArrayName(i): vtk_to_numpy(points.GetArray(i)) for i in range(points.GetNumberOfArrays())
    }
    place = vtk_to_numpy(data.GetPoints().GetData()) if data.GetPoints() is not None else np.zeros((0, 3))
    return {"points": place, **named}
