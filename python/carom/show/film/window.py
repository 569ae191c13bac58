"""A window of VTK that is on no screen, and pictures from it as arrays.

VTK ends the process where it finds no OpenGL, so another process tries first. EGL is asked before OSMesa, and X never: it
would want a display.
"""

from __future__ import annotations

import functools
import subprocess  # noqa: TID251 OpenGL is tried where it may end the process
import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carom.errors import CaromError, extra

#: Classes of VTK's windows in the order in which they are tried.
WINDOWS = ("vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow")
TRIAL = """
import vtkmodules.vtkRenderingOpenGL2 as gl
from vtkmodules.vtkCommonCore import vtkLogger
from vtkmodules.vtkRenderingCore import vtkRenderer
vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
window = gl.{name}()
window.SetOffScreenRendering(True)
window.SetSize(16, 16)
window.AddRenderer(vtkRenderer())
window.Render()
"""
TRIAL_S = 60


def vtk(module: str) -> Any:
    """A module of VTK, as `vtk("vtkRenderingCore")`."""
    return extra(f"vtkmodules.{module}", "films and pictures need VTK", "video")


def off_screen(width: int, height: int) -> Any:
    """A window of that many pixels."""
    vtk("vtkRenderingFreeType")  # letters
    window = getattr(vtk("vtkRenderingOpenGL2"), _usable())()
    window.SetOffScreenRendering(True)
    window.SetMultiSamples(4)
    window.SetSize(width, height)
    return window


@functools.cache
def _usable() -> str:
    vtk("vtkRenderingOpenGL2")
    for name in WINDOWS:
        trial = [sys.executable, "-c", TRIAL.format(name=name)]
        try:
            if subprocess.run(trial, capture_output=True, timeout=TRIAL_S, check=False).returncode == 0:
                return name
        except subprocess.TimeoutExpired:
            continue
    raise CaromError(
        "films and pictures need OpenGL, in software at least, and none was found;"
        " on Debian: apt install libegl1 libgl1-mesa-dri, or libosmesa6"
    )


def pixels(window: Any) -> NDArray[np.uint8]:
    """What the window shows after it was drawn, (height, width, 3), the upper row first."""
    width, height = window.GetSize()
    data = vtk("vtkCommonCore").vtkUnsignedCharArray()
    window.GetPixelData(0, 0, width - 1, height - 1, 0, data, 0)
    found = vtk("util.numpy_support").vtk_to_numpy(data).reshape(height, width, 3)
    return np.ascontiguousarray(found[::-1])
