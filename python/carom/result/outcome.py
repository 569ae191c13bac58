"""How a run ended."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Outcome:
    """How a run ended. `kind` is "done", "stopped", "interrupted", "running", "error" or the core's word, as
    "not_converged".
    """

    kind: str
    step: int | None = None
    time: float | None = None
    level: str | None = None
    bodies: tuple[str, ...] = ()
    residual: float | None = None
    advice: str = ""
    message: str = ""
    """What a function of the user raised, in its own words, or why it stopped the run."""
    problem_file: str | None = None

    @classmethod
    def of(cls, facts: Mapping[str, Any]) -> Outcome:
        """From the dictionary in `run.json`; keys that this version does not know are passed over."""
        known = {k: v for k, v in facts.items() if k in cls.__dataclass_fields__ and v is not None}
        return cls(**{**known, "bodies": tuple(known.get("bodies", ())), "kind": str(facts["kind"])})

    @property
    def ok(self) -> bool:
        """Whether the run reached its end, or the one that a stop condition set."""
        return self.kind in ("done", "stopped")

    @property
    def brief(self) -> str:
        """A few words: `done`, `not converged at t = 0.114 s`."""
        place = "" if self.kind == "done" or self.time is None else f" at t = {self.time:g} s"
        return self.kind.replace("_", " ") + place

    @property
    def failed(self) -> bool:
        """Whether a step could not be computed: neither done nor interrupted nor still running."""
        return self.kind not in ("done", "stopped", "interrupted", "running")

    @property
    def where(self) -> str:
        """What went wrong and where, without advice."""
        parts = [f"{self.kind.replace('_', ' ')}"]
        if self.step is not None and self.time is not None:
            parts.append(f"at step {self.step}, t = {self.time:g} s")
        if self.level:
            parts.append(f"in the {self.level} sub-problem")
        if self.bodies:
            names = list(dict.fromkeys(self.bodies))
            parts.append(("between " if len(names) > 1 else "at ") + " and ".join(names))
        # Of what was refused before it was solved it is no number.
        if self.residual is not None and not math.isnan(self.residual):
            parts.append(f"(residual {self.residual:.3g})")
        if self.message:
            parts.append(f"({self.message})")
        return " ".join(parts)

    def __str__(self) -> str:
        if self.kind == "done":
            return "done"
        text = self.where
        if self.problem_file:
            text += f"; the contact problem is in {self.problem_file}"
        return f"{text}; {self.advice}" if self.advice else text
