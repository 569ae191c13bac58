"""The scenario files that come with Carom."""

from __future__ import annotations

from pathlib import Path

from carom.errors import CaromError, did_you_mean


def shipped() -> dict[str, Path]:
    """The scenarios of the package by name, as `paper/5.6_break`."""
    root = Path(__file__).parents[1] / "scenarios"
    return {f.relative_to(root).with_suffix("").as_posix(): f for f in sorted(root.rglob("*.toml"))}


def named(name: str) -> list[str]:
    """Names of the shipped scenarios that are called so: whole, by the last part, with or without `.toml`."""
    wanted = name.removesuffix(".toml")
    return [key for key in shipped() if wanted in (key, key.rsplit("/", 1)[-1])]


def find(name: str) -> Path:
    """The file of a shipped scenario, by its name, its file name or the last part of either."""
    known, found = shipped(), named(name)
    if len(found) != 1:
        cure = did_you_mean(name.removesuffix(".toml"), list(known))
        raise CaromError(f"no example is called {name!r}; {cure}")
    return known[found[0]]
