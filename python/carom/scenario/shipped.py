"""The scenario files that come with Carom."""

from __future__ import annotations

from pathlib import Path


def shipped() -> dict[str, Path]:
    """The scenarios of the package by name, as `paper/5.6_break`."""
    root = Path(__file__).parents[1] / "scenarios"
    return {f.relative_to(root).with_suffix("").as_posix(): f for f in sorted(root.rglob("*.toml"))}


def named(name: str) -> list[str]:
    """Names of the shipped scenarios that are called so: whole, by the last part, with or without `.toml`."""
    wanted = name.removesuffix(".toml")
    return [key for key in shipped() if wanted in (key, key.rsplit("/", 1)[-1])]
