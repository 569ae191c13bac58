"""The table of impact laws, as the core declares it (`crates/carom-core/src/impact/laws.rs`)."""

from __future__ import annotations

from dataclasses import dataclass

from carom import _core


@dataclass(frozen=True)
class ImpactLaw:
    """One law: what it is, what it needs and what it guarantees."""

    summary: str
    advice: str
    """When to take it."""
    loads_first: bool
    """Loads are solved before impacts, without restitution (rule R2)."""
    energy: bool
    """Impacts cannot add energy (rule R4) while `energy_safeguard` is on."""
    restitution: str
    """What a problem with restitution obeys: `newton`, `printed` (Newton's as in the paper), `poisson` or `energetic`."""
    problems: int
    """Impact problems of an island and step at most; 0: as many as its sequence needs."""
    needs: list[str]
    """Keys of `[[contact]]` that it reads."""
    cite: list[str]
    """Keys of its sources in `carom.reproduce.citations`."""


LAWS = {name: ImpactLaw(**row) for name, row in _core.impact_laws().items()}
