"""The extensions of docs/guides/extend.md: all patches apply and compile; the long tier builds and proves each.

If a patch no longer applies, `tools/patches.sh` makes it again.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from carom import _core
from docs_pages import DOCS, ROOT

PAGE = DOCS / "guides" / "extend.md"
PATCHES = sorted((DOCS / "guides").glob("*.patch"))
#: Always the same place: cargo compiles what Carom is built on once, and later only the copy.
PLACE = ROOT / "target" / "extensions"
PYTHON = ".venv/bin/python"


def section(patch: Path) -> str:
    """What the page says of a patch."""
    (found,) = (part for part in PAGE.read_text("utf-8").split("\n## ") if f"guides/{patch.name}`" in part)
    return found


def commands(patch: Path) -> list[list[str]]:
    """What the page says to run: tables of the reference, tests."""
    lines = re.findall(rf"^    ((?:cargo test|{re.escape(PYTHON)}) .*)$", section(patch), re.M)
    return [shlex.split(line) for line in lines]


def apply(patch: Path, tree: Path, *options: str) -> None:
    """As the page says it, and as if the tree were no folder of another repository, whose root git would start from."""
    command = ["git", "apply", *options, str(patch)]
    environment = {**os.environ, "GIT_CEILING_DIRECTORIES": str(tree.parent)}
    done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr + "run: tools/patches.sh"


@pytest.mark.parametrize("patch", PATCHES, ids=lambda patch: patch.stem)
def test_a_patch_fits_this_version(patch: Path) -> None:
    """It applies as the page says, holds code only, and brings a test that the page runs."""
    assert f"`git apply docs/guides/{patch.name}`" in section(patch)
    files = re.findall(r"^\+\+\+ b/(.*)$", patch.read_text("utf-8"), re.M)
    shown = re.findall(rf"{{literalinclude}} {patch.name}\n(?::.*\n)*?.*\+\+\+ b/([^\"]*)\"", section(patch))
    assert shown
    assert set(shown) <= set(files)
    assert [name for name in files if "tests/" in name]
    assert not [name for name in files if name.endswith(".md")]
    assert any({"test", "pytest"} & set(command) for command in commands(patch))
    apply(patch, ROOT, "--check")


def copy_of_the_tree(tree: Path) -> None:
    """What is or would be in the repository, without what was built."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        check=False,
    )
    if listed.returncode != 0:
        pytest.skip("not a working copy of git")
    shutil.rmtree(tree, ignore_errors=True)
    for name in filter(None, listed.stdout.decode().split("\0")):
        source, target = ROOT / name, tree / name
        if source.is_symlink() or source.is_file():
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(source, target, follow_symlinks=False)


def test_the_core_compiles_with_all_patches() -> None:
    """A patch may apply and name what is called otherwise by now: the compiler looks at core, solvers and their tests."""
    if shutil.which("cargo") is None:
        pytest.skip("no Rust compiler")
    tree = PLACE / "checked"
    copy_of_the_tree(tree)
    for patch in PATCHES:
        if "+++ b/crates/" in patch.read_text("utf-8"):
            apply(patch, tree, "--include=crates/*")
    command = ["cargo", "check", "--quiet", "--release", "--tests", "-p", "carom-core", "-p", "carom-solve"]
    # A place of its own: cargo would take what it finds here for what was built of the working copy itself.
    environment = {**os.environ, "CARGO_TARGET_DIR": str(PLACE / "check")}
    done = subprocess.run(
        command, cwd=tree, env=environment, capture_output=True, text=True, timeout=3600, check=False
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.long
@pytest.mark.parametrize("patch", PATCHES, ids=lambda patch: patch.stem)
def test_an_extension_is_what_the_page_says(patch: Path) -> None:
    """Applied to a copy and built, it passes the tests that the page names."""
    tree = PLACE / "tree"
    copy_of_the_tree(tree)
    apply(patch, tree)
    environment = {
        **os.environ,
        "CARGO_TARGET_DIR": str(PLACE / "build"),
        "PYTHONPATH": str(tree / "python"),
    }

    def run(command: list[str]) -> None:
        done = subprocess.run(
            command, cwd=tree, env=environment, capture_output=True, text=True, timeout=3600, check=False
        )
        assert done.returncode == 0, done.stdout + done.stderr

    extension = Path(_core.__file__)
    if "+++ b/crates/" in patch.read_text("utf-8"):
        if shutil.which("cargo") is None:
            pytest.skip("no Rust compiler")
        run(["cargo", "build", "--release", "-p", "carom-py"])
        shutil.copy(PLACE / "build" / "release" / "lib_core.so", tree / "python" / "carom" / extension.name)
    else:
        shutil.copy(extension, tree / "python" / "carom" / extension.name)
    for program, *arguments in commands(patch):
        run([sys.executable if program == PYTHON else program, *arguments])
