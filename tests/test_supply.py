"""What Carom is built of and what it may do: pinned and checked sources, no `unsafe`, no network, no code in data."""

from __future__ import annotations

import base64
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent


def toml(name: str) -> dict:
    return tomllib.loads((ROOT / name).read_text(encoding="utf-8"))


def pinned() -> dict[str, str]:
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    return dict(line.split("==") for line in lines if not line.startswith("#"))


# ------------------------------------------------------------------------------------------------------- pinned


def test_every_line_of_the_constraints_is_one_exact_version() -> None:
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    assert not [x for x in lines if not re.fullmatch(r"#.*|[a-z0-9-]+==[0-9][0-9a-z.]*", x)]
    names = [x.split("==")[0] for x in lines[1:]]
    assert names == sorted(set(names))


def test_what_the_package_needs_needs_nothing_that_is_not_pinned() -> None:
    """The closure of the dependencies, as their installed metadata state it; markers of other systems left out."""
    from packaging.requirements import Requirement  # comes with pytest

    versions = pinned()
    wanted = [Requirement(line) for line in toml("pyproject.toml")["project"]["dependencies"]]
    seen: set[str] = set()
    while wanted:
        requirement = wanted.pop()
        name = re.sub(r"[-_.]+", "-", requirement.name).lower()
        if name in seen:
            continue
        seen.add(name)
        assert name in versions, f"{name} is installed with Carom and not pinned"
        assert metadata.version(name) == versions[name], name
        needs = map(Requirement, metadata.requires(name) or [])
        wanted += [r for r in needs if r.marker is None or r.marker.evaluate({"extra": ""})]
    assert {"numpy", "h5py", "pydantic-core", "markdown-it-py"} <= seen


@pytest.mark.parametrize("name", ["h5py", "pydantic", "pydantic-core", "typer", "tomli-w"])
def test_what_is_installed_is_what_was_packed(name: str) -> None:
    """Every file of the distribution has the hash that its RECORD states: without the network nothing more can be said."""
    files = [file for file in metadata.files(name) or [] if file.hash]
    assert len(files) > 5
    for file in files:
        data = Path(str(file.locate())).read_bytes()
        digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
        assert (file.hash.mode, file.hash.value) == ("sha256", digest), file


def members() -> list[str]:
    """Manifests of our own crates."""
    return [f"{folder}/Cargo.toml" for folder in toml("Cargo.toml")["workspace"]["members"]]


@pytest.mark.parametrize("lock", ["Cargo.lock", "fuzz/Cargo.lock"])
def test_every_crate_comes_from_the_registry_with_a_checksum(lock: str) -> None:
    ours = {toml(path)["package"]["name"] for path in [*members(), "fuzz/Cargo.toml"]}
    packages = toml(lock)["package"]
    assert packages
    for package in packages:
        if package["name"] in ours:
            assert "source" not in package, package
        else:
            assert package["source"] == "registry+https://github.com/rust-lang/crates.io-index", package
            assert re.fullmatch("[0-9a-f]{64}", package["checksum"]), package


def test_our_own_dependencies_are_exact_versions() -> None:
    """A build without the lock file takes the same versions of what we name."""
    for name, given in toml("Cargo.toml")["workspace"]["dependencies"].items():
        if not name.startswith("carom-"):
            version = given if isinstance(given, str) else given["version"]
            assert version.startswith("="), name
    for path in members():
        for kind in ("dependencies", "dev-dependencies", "build-dependencies"):
            for name, given in toml(path).get(kind, {}).items():
                assert given == {"workspace": True}, f"{path}: {name}"


@pytest.mark.parametrize(("script", "ci"), [("test.sh", "true"), ("check.sh", "true"), ("test.sh", "")])
def test_continuous_integration_takes_the_lock_file_as_it_is(script: str, ci: str, tmp_path: Path) -> None:
    """Every call of cargo that resolves versions is `--locked` there, so that a stale lock file fails."""
    (tmp_path / "tools").mkdir()
    shutil.copy(ROOT / "tools" / script, tmp_path / "tools" / script)
    log = tmp_path / "calls"
    for name in ("bin/cargo", ".venv/bin/python", "tools/audit.sh"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(f'#!/bin/sh\necho "{name} $*" >>"{log}"\n', encoding="utf-8")
        (tmp_path / name).chmod(0o755)
    environment = {**os.environ, "PATH": f"{tmp_path / 'bin'}:{os.environ['PATH']}", "CI": ci}
    command = ["bash", f"tools/{script}", *(["quick"] if script == "test.sh" else [])]
    subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, check=False)
    lines = log.read_text(encoding="utf-8").splitlines()
    assert ("tools/audit.sh " in lines) is (script == "check.sh"), "licences and sources are looked at too"
    calls = [line for line in lines if line.startswith("bin/cargo")]
    resolving = [line for line in calls if line.split()[1] in ("clippy", "test", "build", "run")]
    assert resolving
    assert [("--locked" in line) for line in resolving] == [bool(ci)] * len(resolving), resolving


def test_licences_duplicates_and_sources_of_crates_are_looked_at_by_make_check() -> None:
    deny = toml("deny.toml")
    assert deny["bans"]["multiple-versions"] == deny["bans"]["wildcards"] == "deny"
    assert deny["sources"]["unknown-registry"] == deny["sources"]["unknown-git"] == "deny"
    assert not [x for x in deny["licenses"]["allow"] if "GPL" in x]
    # The exceptions are those of the lock file, no more and no fewer: of several versions all but the newest.
    versions: dict[str, list[str]] = {}
    for package in toml("Cargo.lock")["package"]:
        versions.setdefault(package["name"], []).append(package["version"])
    order = {
        n: sorted(v, key=lambda x: [int(k) for k in x.split("+")[0].split(".")])
        for n, v in versions.items()
        if v[1:]
    }
    older = {f"{name}@{version}" for name, found in order.items() for version in found[:-1]}
    assert {entry["crate"] for entry in deny["bans"]["skip"]} == older


def admitted(expression: str, allowed: set[str]) -> bool:
    """Whether a licence expression (SPDX, or `A/B` of old manifests for a choice) can be kept with these licences."""
    tokens = re.findall(r"[()/]|[^()/\s]+(?:\s+WITH\s+[^()/\s]+)?", expression)

    def one() -> bool:
        token = tokens.pop(0)
        if token != "(":
            return token in allowed
        inner = choice()
        assert tokens.pop(0) == ")", expression
        return inner

    def all_of() -> bool:
        kept = one()
        while tokens and tokens[0] == "AND":
            del tokens[0]
            kept = one() and kept
        return kept

    def choice() -> bool:
        kept = all_of()
        while tokens and tokens[0] in ("OR", "/"):
            del tokens[0]
            kept = all_of() or kept
        return kept

    kept = choice()
    assert not tokens, expression
    return kept


@pytest.mark.parametrize(
    ("expression", "kept"),
    [("MIT", True), ("GPL-3.0-only", False), ("MIT/GPL-3.0-only", True), ("MIT AND GPL-3.0-only", False),
     ("(MIT OR GPL-3.0-only) AND Unicode-3.0", True), ("GPL-3.0-only AND Zlib OR MIT", True),
     ("Apache-2.0 WITH LLVM-exception", True), ("MIT WITH LLVM-exception", False)],
)  # fmt: skip
def test_licence_expressions_are_understood(expression: str, kept: bool) -> None:
    assert admitted(expression, {"MIT", "Unicode-3.0", "Apache-2.0 WITH LLVM-exception"}) is kept


@pytest.mark.parametrize(
    ("manifest", "more"),
    [
        ("Cargo.toml", set()),
        pytest.param("fuzz/Cargo.toml", {"NCSA"}, id="fuzz"),
    ],  # libFuzzer, in nothing that is installed
)
def test_lock_files_fit_and_licences_of_the_crates_are_those_we_allow(manifest: str, more: set[str]) -> None:
    """As cargo-deny sees them, for machines that have none; of the crates that this machine compiles. `make fuzz` has a lock
    file of its own, which a new dependency of the crates had once left behind: nothing else noticed."""
    cargo = shutil.which("cargo")
    if cargo is None:
        pytest.skip("needs cargo")
    host = re.search("host: (.*)", subprocess.check_output(["rustc", "-vV"], text=True))
    assert host
    asked = [cargo, "metadata", "--locked", "--offline", "--format-version=1", f"--manifest-path={manifest}"]
    asked.append(f"--filter-platform={host[1]}")
    done = subprocess.run(asked, cwd=ROOT, capture_output=True, text=True, check=False)
    cure = f"cargo update --workspace --manifest-path {manifest}"
    assert "--locked" not in done.stderr, f"the lock file beside {manifest} is out of date: {cure}"
    if done.returncode:
        pytest.skip(f"crates that were not fetched: {done.stderr.strip()}")
    allowed = more | set(toml("deny.toml")["licenses"]["allow"])
    packages = json.loads(done.stdout)["packages"]
    assert len(packages) > 50
    assert not [p["name"] for p in packages if not admitted(p["license"] or "none", allowed)]


# ------------------------------------------------------------------------------------------------------- unsafe


def test_no_crate_has_unsafe_code() -> None:
    """Forbidden for all of them at one place, which no attribute in the code can take back (`deny` could)."""
    assert toml("Cargo.toml")["workspace"]["lints"]["rust"]["unsafe_code"] == "forbid"
    for path in members():
        assert toml(path)["lints"] == {"workspace": True}, path
    builds = [path for path in members() if (ROOT / path).with_name("build.rs").exists()]
    assert not builds, "nothing of ours runs while it is built"


# ------------------------------------------------------------------------------------------ nothing runs what it reads


@pytest.mark.parametrize(
    "source",
    ["import pickle", "from urllib.request import urlopen", "import subprocess", "eval(x)", "np.load(p)",
     "os.system(x)", "importlib.import_module(x)", "run(x, shell=True)", "import yaml", "import socket"],
)  # fmt: skip
def test_ruff_refuses_what_runs_data_or_reaches_the_network(source: str) -> None:
    """`make check` runs it over the package, and each exception says why where it stands."""
    pytest.importorskip("ruff", reason="ruff is not installed (make dev)")
    command = [
        sys.executable,
        "-m",
        "ruff",
        "check",
        "--no-cache",
        "--stdin-filename",
        "python/carom/some.py",
        "-",
    ]
    text = f"import importlib\nimport os\n\nimport numpy as np\n{source}\n"
    done = subprocess.run(command, cwd=ROOT, input=text, capture_output=True, text=True, check=False)
    assert re.search(r"^(S\d+|TID251) ", done.stdout, re.M), done.stdout


def test_the_viewer_is_built_from_locked_packages() -> None:
    lock = json.loads((ROOT / "viewer" / "package-lock.json").read_text(encoding="utf-8"))
    for name, package in lock["packages"].items():
        if name:
            assert package.get("integrity", "").startswith("sha512-"), name
    wanted = json.loads((ROOT / "viewer" / "package.json").read_text(encoding="utf-8"))
    for group in ("dependencies", "devDependencies"):
        for name, version in wanted[group].items():
            assert re.fullmatch(r"[0-9.]+", version), f"{name} {version}"
            assert lock["packages"][f"node_modules/{name}"]["version"] == version
