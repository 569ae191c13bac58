"""What a convergence study looks at: `velocity`, `velocity:cue`, `velocity:cue:x`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from carom.arrays import F64
from carom.errors import CaromError, among, did_you_mean
from carom.result import kinematics

#: Quantities that are looked at where nothing else is said.
USUAL = ("position", "velocity", "angular_velocity")
#: States by quantity, each (T, N, components).
States = Mapping[str, F64]

#: Quantities of a sphere: their components, and their unit; the usual ones first.
QUANTITIES = {name: kinematics.QUANTITIES[name] for name in (*USUAL, "orientation")}


@dataclass(frozen=True)
class Quantity:
    """A quantity of all spheres (`body` None), of one, or one component of it. `text` is how it was written."""

    text: str
    key: str
    body: str | None = None
    axis: str | None = None

    @classmethod
    def of(cls, text: str, bodies: Sequence[str], others: Mapping[str, str] | None = None) -> Quantity:
        """The quantity that `text` means in a scene with these spheres; of `others` it is told what they are."""
        key, *rest = text.strip().split(":")
        if key not in QUANTITIES:
            raise CaromError(f"no quantity is called {key!r}; {did_you_mean(key, list(QUANTITIES))}")
        letters, _ = QUANTITIES[key]
        axis = rest.pop() if len(rest) > 1 and len(rest[-1]) == 1 and rest[-1] in letters else None
        if not rest:
            return cls(text.strip(), key)
        name = ":".join(rest)  # a name may hold colons
        if name not in bodies:
            cure = (others or {}).get(name) or among(name, bodies)
            raise CaromError(f"{text}: no sphere is called {name!r}; {cure}")
        return cls(text.strip(), key, name, axis)

    @property
    def unit(self) -> str:
        """Its unit, SI."""
        return QUANTITIES[self.key][1]

    @property
    def components(self) -> int:
        """Components of one sphere."""
        return 1 if self.axis else len(QUANTITIES[self.key][0])

    def of_states(self, states: States, bodies: Sequence[str]) -> F64:
        """Its values, (T, spheres, components)."""
        values = states[self.key]
        if self.body is not None:
            values = values[:, [list(bodies).index(self.body)]]
        return values if self.axis is None else values[:, :, [QUANTITIES[self.key][0].index(self.axis)]]

    def aligned(self, found: F64, reference: F64) -> F64:
        """`found` with the signs of quaternions chosen so that they are nearest: q and -q are one orientation."""
        if self.key != "orientation" or self.axis is not None:
            return found
        return np.where(np.sum(found * reference, axis=-1, keepdims=True) < 0, -found, found)
