"""One version everywhere, pins that cover everything, and what a machine lacks said in one line."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from importlib import metadata, resources
from pathlib import Path

import carom
import pytest

ROOT = Path(__file__).parent.parent
CARGO = tomllib.loads((ROOT / "Cargo.toml").read_text(encoding="utf-8"))
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
VERSION = CARGO["workspace"]["package"]["version"]


def test_one_version_everywhere() -> None:
    from carom import _core

    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert PYPROJECT["project"]["dynamic"] == ["version"], "the version is Cargo.toml's"
    assert re.findall(r"^version: (\S+)$", citation, re.M) == [VERSION]
    assert carom.__version__ == VERSION
    assert _core.__version__ == VERSION
    assert metadata.version("carom") == VERSION


def test_the_file_to_cite_by_names_the_works_that_the_command_names() -> None:
    from carom.reproduce.citations import SOURCES

    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    named = re.findall(
        r'^  - type: article\n    title: "(.*)"$', citation.partition("\nreferences:\n")[2], re.M
    )
    assert len(named) == 2
    assert named[0] == SOURCES["method"].partition(" (")[0]
    assert named[1] in SOURCES["newton"]


def test_every_crate_takes_the_version_of_the_workspace() -> None:
    for manifest in (ROOT / "crates").glob("*/Cargo.toml"):
        package = tomllib.loads(manifest.read_text(encoding="utf-8"))["package"]
        assert package["version"] == {"workspace": True}, manifest


def test_the_skin_is_never_linked_by_cargo_test() -> None:
    """`cargo test --workspace` must not need a Python to link against; see the Cargo.toml of carom-py."""
    library = tomllib.loads((ROOT / "crates/carom-py/Cargo.toml").read_text(encoding="utf-8"))["lib"]
    assert [library[key] for key in ("test", "doctest", "bench")] == [False, False, False]
    assert library["name"] == PYPROJECT["tool"]["maturin"]["module-name"].split(".")[-1]


def test_licence_is_the_same_everywhere() -> None:
    assert CARGO["workspace"]["package"]["license"] == PYPROJECT["project"]["license"] == "Apache-2.0"
    assert "license: Apache-2.0" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert "Apache License" in (ROOT / "LICENSE").read_text(encoding="utf-8")


def name_of(requirement: str) -> str:
    return re.sub(r"[-_.]+", "-", re.split(r"[\[<>=!~; ]", requirement.strip())[0]).lower()


def test_everything_that_is_installed_is_pinned() -> None:
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pinned = {name_of(line): line.split("==")[1] for line in lines if not line.startswith("#")}
    wanted = subprocess.run(
        [sys.executable, "tools/requirements.py", "--all"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    ).stdout.split("\n")
    assert not [line for line in wanted if line and name_of(line) not in pinned]


def test_the_tests_run_with_the_pinned_versions() -> None:
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    base = {name_of(requirement) for requirement in PYPROJECT["project"]["dependencies"]}
    pinned = {name_of(line): line.split("==")[1] for line in lines if not line.startswith("#")}
    assert {name: metadata.version(name) for name in base} == {name: pinned[name] for name in base}


def test_the_package_holds_what_it_needs_at_run_time() -> None:
    package = resources.files("carom")
    assert package.joinpath("py.typed").is_file()
    assert package.joinpath("_core.pyi").is_file()
    assert package.joinpath("scenarios", "paper", "5.6_break.toml").is_file()


def test_the_command_is_installed() -> None:
    [script] = metadata.entry_points(group="console_scripts", name="carom")
    assert script.value == "carom.cli:program"
    assert callable(script.load())


# --- what a machine lacks -----------------------------------------------------------------------------------------------

TOOLS = ["sh", "sed", "sort", "head", "printf", "mktemp", "rm", "dirname", "cat"]
GOOD = {
    "cargo": "exit 0",
    "rustc": "echo 'rustc 1.99.0 (0000000 2030-01-01)'",
    "cc": "exit 0",
    "python3": "exit 0",
}
MACHINES = {
    "nothing at all": (
        {"cargo": None, "rustc": None, "cc": None, "python3": None},
        "cargo is missing (Rust 1.85 or newer is needed); no C linker (cc), which Rust needs;"
        " Python 3.11 or newer is needed, found none."
        " Cure: apt-get install gcc libc6-dev python3 python3-venv; install Rust from https://rustup.rs",
    ),
    "Rust too old": (
        {"rustc": "echo 'rustc 1.63.0 (4b91a6ea7 2022-08-08)'"},
        "Rust 1.85 or newer is needed, found 1.63. Cure: install Rust from https://rustup.rs",
    ),
    "Rust too old, of rustup": (
        {"rustc": "echo 'rustc 1.84.1 (e71f9a9a9 2025-01-27)'", "rustup": "exit 0"},
        "Rust 1.85 or newer is needed, found 1.84. Cure: rustup update stable\n",
    ),
    "rustup without a toolchain": (
        {"rustc": "echo 'error: no default toolchain' >&2; exit 1", "rustup": "exit 0"},
        "rustc does not run. Cure: rustup default stable\n",
    ),
    "no linker": ({"cc": None}, "no C linker (cc), which Rust needs. Cure: apt-get install gcc libc6-dev"),
    "no C library": ({"cc": "exit 1"}, "cc cannot link a program. Cure: apt-get install gcc libc6-dev"),
    "no Python": (
        {"python3": None},
        "Python 3.11 or newer is needed, found none. Cure: apt-get install python3 python3-venv",
    ),
    "Python too old": (
        {"python3": '[ "$1" = --version ] && echo "Python 3.9.2" || exit 1'},
        "Python 3.11 or newer is needed, found Python 3.9.2. Cure: use Debian 12 or newer",
    ),
    "no venv": (
        {"python3": 'case "$2" in *ensurepip*) exit 1 ;; esac'},
        "python3 cannot make a virtual environment (no module ensurepip). Cure: apt-get install python3-venv",
    ),
    "no rustfmt": (
        {"cargo": '[ "$1" != fmt ]'},
        "rustfmt is missing. Cure: rustup component add rustfmt",
    ),
}


def preflight(folder: Path, machine: dict[str, str | None], *what: str) -> subprocess.CompletedProcess[str]:
    """Runs the check in a copy of the project without .venv, on a PATH that holds nothing but `machine`."""
    (folder / "tools").mkdir()
    (folder / "bin").mkdir()
    script = (ROOT / "tools/preflight.sh").read_text(encoding="utf-8")
    (folder / "tools/preflight.sh").write_text(script, encoding="utf-8")
    (folder / "Cargo.toml").write_text((ROOT / "Cargo.toml").read_text(encoding="utf-8"), encoding="utf-8")
    for tool in TOOLS:
        [found] = [path for path in ("/bin", "/usr/bin") if os.access(f"{path}/{tool}", os.X_OK)][:1]
        (folder / "bin" / tool).symlink_to(f"{found}/{tool}")
    for name, body in {**GOOD, **machine}.items():
        if body is not None:
            path = folder / "bin" / name
            path.write_text(f"#!/bin/sh\n{body}\n", encoding="utf-8")
            path.chmod(0o755)
    environment = {"PATH": str(folder / "bin"), "HOME": str(folder), "TMPDIR": str(folder)}
    command = ["/bin/sh", "tools/preflight.sh", *(what or ("rust", "rustfmt", "python"))]
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, timeout=60, check=False
    )


def test_a_machine_with_everything_passes(tmp_path: Path) -> None:
    done = preflight(tmp_path, {})
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_the_tests_of_dependencies_may_ask_for_a_newer_rust_than_carom(tmp_path: Path) -> None:
    machine = {"rustc": "echo 'rustc 1.85.1 (4eb161250 2025-03-15)'"}
    (tmp_path / "tests").mkdir()
    (tmp_path / "demo").mkdir()
    assert preflight(tmp_path / "demo", machine, "rust", "python").returncode == 0
    done = preflight(tmp_path / "tests", machine, "rust-tests", "python")
    assert done.returncode == 2
    assert done.stderr.startswith("carom: Rust 1.88 or newer is needed, found 1.85. Cure: ")


@pytest.mark.parametrize("machine", MACHINES)
def test_what_a_machine_lacks_is_said_in_one_line_with_the_cure(machine: str, tmp_path: Path) -> None:
    lacking, message = MACHINES[machine]
    done = preflight(tmp_path, lacking)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1, "one line"
    assert done.stderr.startswith(f"carom: {message}")


# --- what cannot be installed -------------------------------------------------------------------------------------------

#: An interpreter of an environment that installs everything but VTK.
PICKY = """#!/bin/sh
case "$*" in
*"-m pip install"*) for last; do :; done; ! grep -q '^vtk' "$last" ;;
tools/requirements.py*) exec {python} "$@" ;;
esac
"""


@pytest.mark.parametrize(
    ("asked", "code", "told", "stamped"),
    [
        (["--optional", "export", "video", "rl"], 0, "not installed here: video (", False),
        (["--optional", "export", "rl"], 0, "", True),
        (["base", "video"], 2, "installing 'base video' failed", False),
        (["base", "plot"], 0, "", True),
    ],
)
def test_extras_that_cannot_be_installed_are_named_and_stop_nothing(
    tmp_path: Path, asked: list[str], code: int, told: str, stamped: bool
) -> None:
    for name in ("tools/setup.sh", "tools/requirements.py", "pyproject.toml", "constraints.txt"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    python = tmp_path / ".venv/bin/python"
    python.parent.mkdir(parents=True)
    python.write_text(PICKY.format(python=sys.executable), encoding="utf-8")
    python.chmod(0o755)
    done = subprocess.run(
        ["sh", "tools/setup.sh", "stamp", *asked], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (done.returncode, told in done.stderr) == (code, True), done.stderr
    assert (tmp_path / "stamp").exists() is stamped
    assert not list((tmp_path / ".venv/.carom").iterdir()), "no scratch file stays"
