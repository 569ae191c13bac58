"""What a run calls its balls, walls and clumps, and which numbers they have in its arrays and tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from carom.arrays import Array
from carom.errors import CaromError, among
from carom.numeric import is_whole


class UnknownName(CaromError, KeyError):
    """A body, wall or column that is not there: a `KeyError` whose text reads as a sentence."""

    __str__ = CaromError.__str__


class Names:
    """Names in the order of their numbers, and clumps, each with the numbers of its balls; `kind` is said of one of them."""

    def __init__(
        self,
        names: Sequence[str],
        clumps: Mapping[str, Any] | None = None,
        kind: str = "body or wall",
        places: Array | None = None,
    ) -> None:
        """In a part of a run `places` are the numbers in the run of what is named, which those of clumps refer to."""
        self.names, self.clumps = [str(name) for name in names], clumps or {}
        self._kind, self._places = kind, places

    @cached_property
    def array(self) -> Array:
        """The names, and last one for a number that is none of them."""
        return np.array([*self.names, "?"], dtype=object)

    @cached_property
    def _known(self) -> dict[str, int]:
        return {name: number for number, name in enumerate(self.names)}

    def numbers(self, wanted: Any) -> list[int]:
        """Those of what is called so: one, or of a clump all its balls; a number that is there means itself."""
        if is_whole(wanted) and 0 <= wanted < len(self.names):
            return [int(wanted)]
        if isinstance(wanted, str):
            if wanted in self._known:
                return [self._known[wanted]]
            if wanted in self.clumps:
                balls = np.asarray(self.clumps[wanted])
                found = balls if self._places is None else np.flatnonzero(np.isin(self._places, balls))
                return list(map(int, found))
        kind = self._kind.replace(" or ", ", ") + " or clump" if self.clumps else self._kind
        raise UnknownName(f"no {kind} is called {wanted!r}; {among(str(wanted), [*self.clumps], self.names)}")

    def pair(self, first: Any, second: Any) -> tuple[list[int], list[int]]:
        """Those of two that may meet."""
        a, b = self.numbers(first), self.numbers(second)
        if set(a) & set(b):
            raise CaromError(f"{first!r} and {second!r} are one body; a contact is of two")
        return a, b
