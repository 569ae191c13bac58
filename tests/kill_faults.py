"""Faults on demand: a library that is preloaded into a run (`fault_shim.c`), and file systems of one's own."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

CAROM = [sys.executable, "-m", "carom"]


def built(folder: Path) -> Path:
    """The shim, compiled; skips the test where that cannot be."""
    compiler = shutil.which("cc")
    if compiler is None or not sys.platform.startswith("linux"):
        pytest.skip("faults are injected by a preloaded library, which needs Linux and a C compiler")
    library = folder / "fault_shim.so"
    source = Path(__file__).with_name("fault_shim.c")
    flags = ["-shared", "-fPIC", "-O1", "-Wall", "-Wextra", "-Werror"]
    subprocess.run([compiler, *flags, "-o", str(library), str(source), "-ldl"], check=True)
    return library


def environment(shim: Path, run: Path, **values: str | int) -> dict[str, str]:
    """The environment in which the shim acts on the files of `run`: `at`, `kind`, `count`, `split`, `clock`."""
    given = {f"FAULT_{key.upper()}": str(value) for key, value in values.items()}
    return {"LD_PRELOAD": str(shim), "FAULT_DIR": str(run), **given}


def in_namespace(script: str, *, probe: str) -> subprocess.CompletedProcess[str]:
    """Run a shell script as the root of its own mounts; skips the test unless `probe` is possible there."""
    if shutil.which("unshare") is None:
        pytest.skip("file systems of one's own need the program unshare")
    inside = ["unshare", "--user", "--map-root-user", "--mount", "sh", "-ec"]
    tried = subprocess.run([*inside, probe], capture_output=True, text=True, check=False)
    if tried.returncode:
        pytest.skip(f"no mounts of one's own here: {tried.stderr.strip()}")
    return subprocess.run(
        [*inside, script],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "CAROM": " ".join(CAROM)},
    )
