"""The code of the documentation: what each page shows, run in the order of the page as a reader would."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
NOTEBOOK = "file_format: mystnb"

#: Stands before the code of a page: `!carom run x.toml` is a command, as in a notebook.
PRELUDE = """\
import os, subprocess
def _command(line):
    subprocess.run(line, shell=True, check=True, stdout=subprocess.DEVNULL)
"""


def notebooks() -> list[Path]:
    """The pages that are executed when the documentation is built."""
    return [page for page in sorted(DOCS.rglob("[!_]*.md")) if NOTEBOOK in page.read_text("utf-8")[:200]]


def blocks(page: Path, language: str) -> list[str]:
    """The fenced blocks of a page in one language, options (`:tags: [...]`) taken away."""
    found = re.findall(rf"^```{re.escape(language)}\n(.*?)^```", page.read_text("utf-8"), re.S | re.M)
    return [re.sub(r"\A(:\w.*\n)+", "", block) for block in found]


def program(page: Path) -> str:
    """All cells of a notebook as one program that plain Python runs: `n = 10_000  # in tests 200` has 200."""
    cells = blocks(page, "{code-cell} python")
    assert cells, f"{page} has no cells"
    code = re.sub(r"= \S+  # in tests (\S+)$", r"= \1", "\n\n".join(cells), flags=re.M)
    return PRELUDE + re.sub(r"^( *)!(.*)$", lambda m: f"{m[1]}_command({m[2]!r})", code, flags=re.M)


def run(code: str, folder: Path) -> str:
    """Run a program in a folder of its own, as a build of the documentation would; its output."""
    return interpret(["-c", code], folder)


def interpret(arguments: list[str], folder: Path) -> str:
    """Run Python there; its output."""
    environment = {
        **os.environ,
        "MPLBACKEND": "agg",
        "MATPLOTLIBRC": str(DOCS / "matplotlibrc"),
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
    }
    done = subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


#: Notebooks with code of the billiards kit.
KIT = [page for page in notebooks() if "billiards" in program(page)]
