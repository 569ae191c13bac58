"""Which Carom computed the rows of a study: the version and the build of its core, in two columns of every row.

The name of a case is a hash of what it is and not of who computes it: a study that is continued keeps the rows of an older
Carom, whose numbers may differ. That is said, and left to the user.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from carom.errors import counted
from carom.run.summary import versions

#: Names of the columns.
COLUMNS = ("carom", "build")
#: Letters of a build that are printed.
SHORT = 8


class Origin(NamedTuple):
    """Version of the core, and the identity of its build as the linker gave it; empty where it is not known."""

    carom: str
    build: str

    def __str__(self) -> str:
        if not self.carom:
            return "a Carom that did not say its version"
        return f"Carom {self.carom}" + (f" (build {self.build[:SHORT]})" if self.build else "")


def here() -> Origin:
    """That of this process."""
    return of(versions())


def of(versions: Mapping[str, str]) -> Origin:
    """That of a run, from what it says of its versions."""
    return Origin(str(versions.get("core", "")), str(versions.get("build", "")))


def remark(there: Mapping[Origin, int], mine: Origin) -> str | None:
    """What to say before rows of `mine` join others, counted by their origin; None if all may be alike."""
    others = {origin: count for origin, count in there.items() if _differs(origin, mine)}
    if not others:
        return None
    versions = any(origin.carom != mine.carom for origin in others)
    risk = (
        "other versions may compute other numbers"
        if versions
        else "only the same build is sure to give the same bits"
    )
    return (
        f"there already: {listed(others)}; this is {mine}, and {risk}. The columns `carom` and `build` of the table say"
        " whose each row is; to have all of one kind, compute the study in another folder"
    )


def listed(there: Mapping[Origin, int]) -> str:
    """`3 cases by Carom 0.1.0, 1 case by Carom 0.2.0`, the most first."""
    return ", ".join(
        f"{counted(count, 'case')} by {origin}" for origin, count in Counter(there).most_common()
    )


def tally(carom: Sequence[str | None], build: Sequence[str | None]) -> Counter[Origin]:
    """Rows by their origin, from the two columns; those of parts that have no such columns hold None."""
    return Counter(Origin(a or "", b or "") for a, b in zip(carom, build, strict=True))


def _differs(one: Origin, other: Origin) -> bool:
    """Builds of one version may be the same where one of them is not known."""
    return one.carom != other.carom or bool(one.build and other.build and one.build != other.build)
