"""The numbers on billiard balls, drawn once into one texture, each in its cell of a square."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from carom.show.film.window import vtk

CELL = 128
"""Pixels along a cell."""


def atlas(labels: Sequence[str]) -> tuple[Any, int]:
    """A texture, white where there is ink, and how many cells it has along a side; rows count from below."""
    side = max(1, math.ceil(math.sqrt(len(labels))))
    sheet = np.zeros((CELL * side, CELL * side), dtype=np.uint8)
    for k, label in enumerate(labels):
        row, column = CELL * (k // side), CELL * (k % side)
        sheet[row : row + CELL, column : column + CELL] = _drawn(label)
    image = vtk("vtkCommonDataModel").vtkImageData()
    image.SetDimensions(*sheet.shape, 1)
    image.GetPointData().SetScalars(vtk("util.numpy_support").numpy_to_vtk(sheet.reshape(-1, 1), deep=True))
    texture = vtk("vtkRenderingOpenGL2").vtkOpenGLTexture()
    texture.SetInputData(image)
    texture.SetColorModeToDirectScalars()
    texture.InterpolateOn()
    texture.MipmapOn()
    return texture, side


def _drawn(label: str) -> np.ndarray:
    cell = np.zeros((CELL, CELL), dtype=np.uint8)
    if not label:
        return cell
    core = vtk("vtkRenderingCore")
    vtk("vtkRenderingFreeType")  # the letters
    look = core.vtkTextProperty()
    look.SetFontFamilyToArial()
    look.BoldOn()
    look.SetColor(1.0, 1.0, 1.0)
    look.SetFontSize(round(CELL * {1: 0.74, 2: 0.6}.get(len(label), 0.44)))
    image = vtk("vtkCommonDataModel").vtkImageData()
    core.vtkTextRenderer.GetInstance().RenderString(look, label, image, [0, 0], 72)
    width, height, _ = image.GetDimensions()
    ink = (
        vtk("util.numpy_support").vtk_to_numpy(image.GetPointData().GetScalars())[:, 3].reshape(height, width)
    )
    rows, columns = np.flatnonzero(ink.any(axis=1)), np.flatnonzero(ink.any(axis=0))
    ink = ink[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1][:CELL, :CELL]
    top, left = ((CELL - n) // 2 for n in ink.shape)
    cell[top : top + ink.shape[0], left : left + ink.shape[1]] = ink
    if label in ("6", "9"):  # so that they are told apart
        cell[top - CELL // 8 : top - CELL // 16, left : left + ink.shape[1]] = 255
    return cell
