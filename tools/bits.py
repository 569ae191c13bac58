"""Do two builds of Carom compute the same bits? If not: which column of which case differs, and from which step on.

    python tools/bits.py compare --old FOLDER [--size full] [--threads 1 2 4] [--only TEXT]
    python tools/bits.py check                # this build against the hashes of tests/data/bits.json (`make test`)
    python tools/bits.py renew                # write them anew, after a change that is meant to change results

FOLDER is another working copy with its extension built (`benches/against.py` says how). Both builds run the cases of
this copy: the scenarios, the paper's examples, the states of jammed balls, the contact problems, random drops, a pile,
moving walls and a periodic box. Every recorded column and the last state are hashed step by step.

The bits of one build are the same on any machine of one kind. Another processor or C library may round sine and cosine
differently; where hashes differ on one, `check` says so and exits with 3.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import pickle
import platform
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import bits_cases
from bits_cases import ROOT, Columns

HASHES = ROOT / "tests" / "data" / "bits.json"
SAME, DIFFERENT, ELSEWHERE = 0, 1, 3


def machine() -> str:
    """What the bits depend on besides the build: the processor and the C library."""
    lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines() if sys.platform == "linux" else []
    facts = {name.strip(): value.strip() for name, _, value in (line.partition(":") for line in lines)}
    kind = [facts.get(name, "") for name in ("model name", "cpu family", "model")]
    return ", ".join([*filter(None, kind), platform.machine(), *platform.libc_ver()])


def computed(size: str, threads: int, only: str) -> dict[str, Columns]:
    """All cases by this process' Carom."""
    found = {}
    for name, case in bits_cases.every(size).items():
        if only in name:
            begin = time.perf_counter()
            found[name] = case(threads=threads)
            print(f"{time.perf_counter() - begin:8.2f} s  {name}", file=sys.stderr, flush=True)
    return found


def by_build(folder: Path, size: str, threads: int, only: str) -> dict[str, Columns]:
    """All cases by the build in a folder, in a process of its own."""
    with tempfile.TemporaryDirectory() as place:
        path = Path(place, "found")
        command = [sys.executable, __file__, "compute", "--size", size, "--threads", str(threads)]
        command += ["--only", only, "--into", str(path)]
        subprocess.run(command, env={**os.environ, "PYTHONPATH": str(folder / "python")}, check=True)
        return pickle.loads(path.read_bytes())  # type: ignore[no-any-return]  # written by the process just ended


def first_difference(old: Columns, new: Columns) -> list[str]:
    """Columns that differ, the earliest step first."""
    found = []
    for name in sorted(old.keys() | new.keys()):
        if name not in old or name not in new:
            found.append((-1, f"{name}: only in the {'new' if name in new else 'old'} build"))
            continue
        (steps, was), (now_steps, now) = old[name], new[name]
        both = min(len(was), len(now))
        apart = (was[:both] != now[:both]) | (steps[:both] != now_steps[:both])
        if apart.any() or len(was) != len(now):
            step = int(steps[apart.argmax()]) if apart.any() else both
            found.append((step, f"{name}: from step {step} on"))
    return [text for _, text in sorted(found)]


def compare(old: Path, size: str, threads: list[int], only: str) -> int:
    """Both builds, with each number of threads; every run also against that of the old build on one thread."""
    apart = compared = 0
    reference = by_build(old, size, threads[0], only)
    for build, folder in (("old", old), ("new", ROOT)):
        for count in threads:
            if build == "old" and count == threads[0]:
                continue
            found = by_build(folder, size, count, only)
            for name in sorted(reference.keys() | found.keys()):
                lines = first_difference(reference.get(name, {}), found.get(name, {}))
                compared += 1
                if lines:
                    apart += 1
                    print(f"{name}, {build} build, {count} threads: {len(lines)} columns differ")
                    print("".join(f"    {line}\n" for line in lines[:3]), end="", flush=True)
    print(f"{compared} runs compared, {apart} differ")
    return DIFFERENT if apart else SAME


def tables(columns: Columns) -> dict[str, str]:
    """One hash of all columns of each table of a case."""
    sums: dict[str, Any] = {}
    for name in sorted(columns):
        whole = sums.setdefault(name.partition("/")[0], hashlib.blake2b(digest_size=8))
        whole.update(name.encode() + b"".join(part.tobytes() for part in columns[name]))
    return {table: whole.hexdigest() for table, whole in sums.items()}


def check(renew: bool) -> int:
    """The short cases on 1 and 2 threads against the hashes that are kept."""
    kept = json.loads(HASHES.read_text(encoding="utf-8")) if HASHES.exists() else {"machine": "", "cases": {}}
    cases, threaded = (
        {name: tables(found) for name, found in computed("short", n, "").items()} for n in (1, 2)
    )
    apart = differing(cases, threaded, "1 and 2 threads differ in")
    if renew:
        text = json.dumps({"machine": machine(), "cases": cases}, indent=0)
        HASHES.write_text(text + "\n", encoding="utf-8")
    elif changed := differing(kept["cases"], cases, "not what it was:"):
        if kept["machine"] != machine() and not apart:
            print(
                f"{len(changed)} of {len(cases)} cases differ, but those bits are of {kept['machine']}, not of {machine()}"
            )
            return ELSEWHERE
        apart += changed
    print("\n".join([*apart, f"{len(cases)} cases compared, {len(apart)} differ"]))
    return DIFFERENT if apart else SAME


def differing(a: dict[str, dict[str, str]], b: dict[str, dict[str, str]], what: str) -> list[str]:
    """A line for each case whose tables are not the same."""
    lines = []
    for name in sorted(a.keys() | b.keys()):
        one, other = a.get(name, {}), b.get(name, {})
        apart = [table for table in sorted(one.keys() | other.keys()) if one.get(table) != other.get(table)]
        lines += [f"{name}: {what} {', '.join(apart)}"] if apart else []
    return lines


def main() -> int:
    """The command."""
    options = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    options.add_argument("command", choices=("compare", "check", "renew", "compute"))
    options.add_argument("--old", type=Path, metavar="FOLDER", help="a working copy of another commit, built")
    options.add_argument("--size", choices=("short", "full"), default="full")
    options.add_argument("--threads", type=int, nargs="+", default=[1, 2, 4])
    options.add_argument("--only", default="", metavar="TEXT", help="cases whose names hold this text")
    options.add_argument("--into", type=Path, help=argparse.SUPPRESS)
    given = options.parse_args()
    if given.command == "compute":
        given.into.write_bytes(pickle.dumps(computed(given.size, given.threads[0], given.only)))
        return SAME
    if given.command == "compare":
        if given.old is None:
            options.error("compare needs --old FOLDER")
        return compare(given.old.resolve(), given.size, given.threads, given.only)
    return check(given.command == "renew")


if __name__ == "__main__":
    sys.exit(main())
