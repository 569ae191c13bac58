"""What Carom is built of and what it may do: pinned and checked sources, no `unsafe`, no network, no code in data."""

from __future__ import annotations

import ast
import base64
import hashlib
import json
import re
import shutil
import subprocess
import tomllib
from importlib import metadata
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "python" / "carom"


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


def test_continuous_integration_takes_the_lock_file_as_it_is() -> None:
    assert re.search(r"^export CI=", (ROOT / ".ci" / "run").read_text(encoding="utf-8"), re.M)
    for name in ("tools/check.sh", "tools/test.sh"):
        text = (ROOT / name).read_text(encoding="utf-8")
        assert "locked=${CI:+--locked}" in text
        lines = [x for x in text.splitlines() if not x.startswith(("#", "echo"))]
        calls = [x for x in lines if re.search(r"\bcargo (clippy|test|build|run)\b", x)]
        assert calls
        assert not [x for x in calls if "$locked" not in x]
    [build] = [
        x for x in (ROOT / "Makefile").read_text(encoding="utf-8").splitlines() if "maturin develop" in x
    ]
    assert "$(if $(CI),--locked)" in build


def test_licences_duplicates_and_sources_of_crates_are_looked_at_by_make_check() -> None:
    deny = toml("deny.toml")
    assert deny["bans"]["multiple-versions"] == deny["bans"]["wildcards"] == "deny"
    assert deny["sources"]["unknown-registry"] == deny["sources"]["unknown-git"] == "deny"
    assert not [x for x in deny["licenses"]["allow"] if "GPL" in x]
    assert 'step "audit" tools/audit.sh' in (ROOT / "tools/check.sh").read_text(encoding="utf-8")
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


def code_of(text: str) -> str:
    """Rust without comments and strings, near enough for a word to be looked for."""
    text = re.sub(r"/\*.*?\*/", " ", text, flags=re.S)
    text = re.sub(r'r(#*)".*?"\1', '""', text, flags=re.S)
    text = re.sub(r'"(?:\\.|[^"\\])*"', '""', text, flags=re.S)
    return re.sub(r"//[^\n]*", " ", text)


def test_no_crate_has_unsafe_code() -> None:
    """Forbidden for all of them at one place, which no attribute in the code can take back (`deny` could)."""
    assert toml("Cargo.toml")["workspace"]["lints"]["rust"]["unsafe_code"] == "forbid"
    for path in members():
        assert toml(path)["lints"] == {"workspace": True}, path
    sources = [file for path in members() for file in sorted((ROOT / path).parent.glob("**/*.rs"))]
    assert len(sources) > 100
    found = [
        str(p.relative_to(ROOT)) for p in sources if re.search(r"\bunsafe\b", code_of(p.read_text("utf-8")))
    ]
    assert not found
    builds = [path for path in members() if (ROOT / path).with_name("build.rs").exists()]
    assert not builds, "nothing of ours runs while it is built"


def test_the_scanner_sees_unsafe_and_nothing_else() -> None:
    assert "unsafe" in code_of('let a = "x"; unsafe { b() } // safe')
    assert "unsafe" not in code_of(
        '// unsafe\n/* unsafe */ let s = "unsafe \\" unsafe"; let r = r#"unsafe"#;'
    )


# ------------------------------------------------------------------------------------------ nothing runs what it reads

FORBIDDEN = {
    "pickle", "_pickle", "cPickle", "marshal", "shelve", "dill", "cloudpickle", "joblib", "yaml", "code", "codeop",
    "ctypes", "cffi", "runpy", "socket", "ssl", "http", "urllib", "ftplib", "smtplib", "xmlrpc", "requests", "httpx",
    "aiohttp",
}  # fmt: skip
PROCESSES = {"subprocess", "multiprocessing", "concurrent"}
#: Where processes are started, and why.
STARTS = {
    "view/browser.py": "the browser of `carom plot --view` and the tests",
    "paper/runner.py": "examples of the paper side by side",
    "problem/solve.py": "a thread that waits for the solver",
    "study.py": "runs of a study side by side",
    "sweeps/cluster.py": "the exception of a case that was called off",
    "film/encode.py": "ffmpeg, which writes films",
    "film/window.py": "a trial of OpenGL, which ends a process where there is none",
}
#: Modules that one source may have all the same, and why.
EXCEPTIONS = {
    ("record/opening.py", "ctypes"): "a setting of HDF5 of which h5py knows nothing",
    ("allocator.py", "ctypes"): "a setting of the C library of which Python knows nothing",
    ("cli/sweep.py", "runpy"): "the function that the user names with --measure",
}
CALLS = {"eval", "exec", "compile", "__import__", "breakpoint"}
SYSTEM = {"system", "popen", "execv", "execve", "execvp", "spawnv", "posix_spawn", "startfile"}
#: Modules by name: the lazy names of the package, those of its own examples, and VTK's.
IMPORTERS = {"__init__.py", "paper/runner.py", "export/__init__.py", "film/window.py"}


def faults(tree: ast.AST, name: str) -> list[str]:
    """What a source does that could run data as code or reach the network."""
    found = []
    for node in ast.walk(tree):
        line = getattr(node, "lineno", 0)
        modules = []
        if isinstance(node, ast.Import):
            modules = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            modules = [node.module or ""]
        for module in modules:
            top = module.split(".")[0]
            if (top in FORBIDDEN and (name, top) not in EXCEPTIONS) or (
                top in PROCESSES and name not in STARTS
            ):
                found.append(f"{name}:{line}: import {module}")
        if isinstance(node, ast.Call):
            called = node.func
            if isinstance(called, ast.Name) and called.id in CALLS:
                found.append(f"{name}:{line}: {called.id}()")
            if isinstance(called, ast.Attribute):
                owner = called.value.id if isinstance(called.value, ast.Name) else ""
                if owner == "os" and called.attr in SYSTEM:
                    found.append(f"{name}:{line}: os.{called.attr}()")
                if called.attr == "import_module" and name not in IMPORTERS:
                    found.append(f"{name}:{line}: import_module()")
                if owner in ("np", "numpy") and called.attr == "load":
                    flags = [k.value for k in node.keywords if k.arg == "allow_pickle"]
                    if not (flags and isinstance(flags[0], ast.Constant) and flags[0].value is False):
                        found.append(f"{name}:{line}: numpy.load without allow_pickle=False")
            if isinstance(called, ast.Name) and called.id == "import_module" and name not in IMPORTERS:
                found.append(f"{name}:{line}: import_module()")
            if any(
                k.arg == "allow_pickle" and not (isinstance(k.value, ast.Constant) and k.value.value is False)
                for k in node.keywords
            ):
                found.append(f"{name}:{line}: allow_pickle")
            if any(
                k.arg == "shell" and not (isinstance(k.value, ast.Constant) and k.value.value is False)
                for k in node.keywords
            ):
                found.append(f"{name}:{line}: a shell")
    return found


def test_no_source_runs_data_or_reaches_the_network() -> None:
    sources = sorted(PACKAGE.rglob("*.py"))
    assert len(sources) > 80
    found = []
    for path in sources:
        found += faults(ast.parse(path.read_text(encoding="utf-8")), str(path.relative_to(PACKAGE)))
    assert not found
    assert not [name for name in (*STARTS, *IMPORTERS) if not (PACKAGE / name).is_file()]


@pytest.mark.parametrize(
    "source",
    ["import pickle", "from urllib.request import urlopen", "import subprocess", "eval(x)", "np.load(p)",
     "np.load(p, allow_pickle=True)", "np.savez(p, allow_pickle=flag)", "os.system(x)", "import_module(x)",
     "importlib.import_module(x)", "run(x, shell=True)", "import yaml"],
)  # fmt: skip
def test_the_scanner_sees(source: str) -> None:
    assert faults(ast.parse(source), "some.py")


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
