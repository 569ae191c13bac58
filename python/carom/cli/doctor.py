"""`carom doctor`."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

from carom.cli.options import Json
from carom.cli.output import BAD_INPUT, DONE, emit, guarded
from carom.files import unwritable


@guarded
def doctor(as_json: Json = False) -> int:
    """Check that the installation works, and list missing extras.

    Example: carom doctor
    """
    findings = [_try(name, test) for name, test in TESTS.items()]
    good = all(f["ok"] or f["optional"] for f in findings)
    if as_json:
        emit({"ok": good, "findings": findings})
    else:
        for f in findings:
            mark = "ok" if f["ok"] else ("absent" if f["optional"] else "FAILED")
            print(f"{mark:7} {f['name']:16} {f['found']}")
        print("all is well" if good else "something is wrong, see above")
    return DONE if good else BAD_INPUT


def _try(name: str, test: Callable[[], str]) -> dict[str, Any]:
    optional = name in OPTIONAL
    try:
        return {"name": name, "ok": True, "optional": optional, "found": test()}
    except Exception as error:
        told = " ".join(str(error).split()) or type(error).__name__
        if optional:
            told = f"not installed: {OPTIONAL[name]}"
        return {"name": name, "ok": False, "optional": optional, "found": told}


def _python() -> str:
    return f"{sys.version.split()[0]} ({sys.executable})"


def _core() -> str:
    from carom import _core

    return f"{_core.__version__}, {len(_core.defaults())} numerical options"


def _record() -> str:
    """HDF5 with one writer and a reader at work at the same time, as every run uses it."""
    import tempfile
    from pathlib import Path

    import h5py

    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "probe.h5"
        with h5py.File(path, "w", libver="latest") as file:
            data = file.create_dataset("x", (0,), "f8", maxshape=(None,), chunks=(16,))
            file.swmr_mode = True
            data.resize(3, axis=0)
            data.flush()
            with h5py.File(path, "r", libver="latest", swmr=True) as reader:
                if reader["x"].shape != (3,):
                    raise RuntimeError("HDF5 cannot read a file that is being written here")
    return f"h5py {h5py.__version__}, HDF5 {h5py.version.hdf5_version}, reads while it writes"


def _directory() -> str:
    import shutil
    import tempfile

    try:
        with tempfile.TemporaryFile(dir="."):
            pass
    except OSError as error:
        raise RuntimeError(f"not writable: {unwritable(error)}, or change to another directory") from error
    return f"writable, {shutil.disk_usage('.').free / 1e9:.1f} GB free"


def _a_run() -> str:
    import carom

    result = carom.simulate(carom.example("three_balls"))
    return f"{result.summary['steps']} steps in {1e3 * result.summary['wall_s']:.0f} ms"


def _machine() -> str:
    import platform

    from carom.many.batch import usable_processors

    return f"{platform.system()} {platform.machine()}, {usable_processors()} usable CPUs"


def _viewer() -> str:
    from importlib.resources import files

    script = files("carom.show.viewer") / "assets" / "viewer.js"
    return f"{len(script.read_bytes()) / 1e6:.1f} MB in one file, no network needed"


def _extra(*modules: str) -> Callable[[], str]:
    """Whether the packages of an extra are installed, and which; they are not imported, which takes seconds for some."""

    def test() -> str:
        from importlib.metadata import version

        return ", ".join(f"{module} {version(module)}" for module in modules)

    return test


TESTS: dict[str, Callable[[], str]] = {
    "machine": _machine,
    "Python": _python,
    "compiled core": _core,
    "NumPy": _extra("numpy"),
    "results file": _record,
    "this directory": _directory,
    "a short run": _a_run,
    "viewer": _viewer,
    "plots": _extra("matplotlib"),
    "tables": _extra("xarray", "pandas"),
    "export": _extra("pyarrow", "gsd"),
    "studies": _extra("dask", "distributed", "scipy"),
    "fits": _extra("dask", "distributed", "scipy", "scikit-learn"),
    "live view": _extra("viser"),
    "films": _extra("vtk", "imageio-ffmpeg"),
    "meshes": _extra("trimesh"),
}
OPTIONAL = {
    "plots": "pip install 'carom[plot]' for figures",
    "tables": "pip install 'carom[interop]' for to_xarray and to_pandas",
    "export": "pip install 'carom[export]' for Parquet and GSD; other formats need nothing",
    "studies": "pip install 'carom[cluster]' for carom sweep",
    "fits": "pip install 'carom[fit]' for carom fit",
    "live view": "pip install 'carom[live]' for carom view --live",
    "films": "pip install 'carom[video]' for MP4, GIF and PNG by carom export",
    "meshes": "pip install 'carom[mesh]' for [[mesh]] from STL, OBJ and PLY files",
}
