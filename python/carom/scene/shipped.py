"""The scenario files that come with Carom."""

from __future__ import annotations

from pathlib import Path

from carom.errors import CaromError, did_you_mean

#: Names that an error offers.
MOST_MEANT = 4


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
        wanted = name.removesuffix(".toml")
        # People remember the word and not the number before it: `throw` of `paper/5.3_throw`.
        having = [key for key in known if wanted and wanted.lower() in key.lower()]
        cure = (
            f"did you mean {' or '.join(having)}?"
            if 0 < len(having) <= MOST_MEANT
            else did_you_mean(wanted, list(known))
        )
        raise CaromError(f"no example is called {name!r}; {cure}")
    return known[found[0]]
