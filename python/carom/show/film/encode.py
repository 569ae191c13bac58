"""Pictures into files: MP4 (H.264) and GIF by ffmpeg, which the package imageio-ffmpeg brings, PNG by VTK."""

from __future__ import annotations

import subprocess  # noqa: TID251 ffmpeg
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carom.errors import CaromError, extra
from carom.files import RecordError
from carom.show.film.look import Look
from carom.show.film.window import vtk

Picture = NDArray[np.uint8]

#: H.264 that every player shows, at a quality at which its losses are not seen; the index stands in front, for the web.
H264 = [
    "-c:v",
    "libx264",
    "-preset",
    "medium",
    "-crf",
    "18",
    "-pix_fmt",
    "yuv420p",
    "-movflags",
    "+faststart",
    "-f",
    "mp4",
]
#: Without losses and fast, for what is encoded again.
LOSSLESS = ["-c:v", "libx264rgb", "-preset", "ultrafast", "-qp", "0", "-f", "matroska"]


def ffmpeg() -> str:
    """The program, where it is."""
    imageio_ffmpeg = extra("imageio_ffmpeg", "films need imageio-ffmpeg", "video")
    try:
        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except RuntimeError as error:
        raise CaromError(f"no ffmpeg was found ({error}); set IMAGEIO_FFMPEG_EXE to where it is") from error


def mp4(pictures: Iterator[Picture], look: Look, path: Path) -> None:
    """Write a film."""
    _film(pictures, look, path, H264)


def gif(pictures: Iterator[Picture], look: Look, path: Path) -> None:
    """Write a GIF, whose 256 colours are the best for all pictures together: they have to be seen twice."""
    # Named so that the next export clears them away if this one is killed.
    whole, palette = (
        path.with_name(path.name.replace(".gif", f".gif.{part}", 1)) for part in ("all", "palette")
    )
    try:
        _film(pictures, look, whole, LOSSLESS)
        first = "-vf palettegen=stats_mode=diff -c:v png -f image2 -update 1"
        _run("-i", str(whole), *first.split(), str(palette))
        way = "paletteuse=dither=bayer:bayer_scale=4:diff_mode=rectangle"
        _run("-i", str(whole), "-i", str(palette), "-lavfi", way, "-loop", "0", "-f", "gif", str(path))
    finally:
        whole.unlink(missing_ok=True)
        palette.unlink(missing_ok=True)


def png(picture: Picture, path: Path) -> None:
    """Write a picture."""
    image = vtk("vtkCommonDataModel").vtkImageData()
    height, width = picture.shape[:2]
    image.SetDimensions(width, height, 1)
    rows = np.ascontiguousarray(picture[::-1]).reshape(-1, 3)
    image.GetPointData().SetScalars(vtk("util.numpy_support").numpy_to_vtk(rows, deep=True))
    writer = vtk("vtkIOImage").vtkPNGWriter()
    writer.SetInputData(image)
    writer.WriteToMemoryOn()
    writer.Write()
    path.write_bytes(vtk("util.numpy_support").vtk_to_numpy(writer.GetResult()).tobytes())


def _film(pictures: Iterator[Picture], look: Look, path: Path, how: list[str]) -> None:
    raw = f"-f rawvideo -pix_fmt rgb24 -s {look.width}x{look.height} -r {look.fps:.6g}".split()
    with _started(*raw, "-i", "-", *how, str(path)) as process:
        for picture in pictures:
            try:
                process.stdin.write(picture.tobytes())
            except BrokenPipeError:
                break  # it says why when it has ended


def _run(*arguments: str) -> None:
    with _started(*arguments):
        pass


@contextmanager
def _started(*arguments: str) -> Iterator[Any]:
    """ffmpeg at work; it gets no Ctrl-C of its own, and what goes wrong here ends it."""
    command = [ffmpeg(), "-v", "error", "-nostdin", "-y", *arguments]
    with subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        start_new_session=True,
    ) as process:
        try:
            yield process
            _, said = process.communicate()
        except BaseException:
            process.kill()
            with suppress(OSError):  # of what it will not read any more
                if process.stdin is not None:
                    process.stdin.close()
            raise
    if process.returncode:
        words = said.decode(errors="replace").strip().splitlines() or [f"exit code {process.returncode}"]
        raise RecordError(f"cannot write {arguments[-1]}: ffmpeg: {words[-1]}")
