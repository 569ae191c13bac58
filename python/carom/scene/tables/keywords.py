"""The keys of `[run]` and `[record]` as keywords of `carom.simulate`. Written by tools/keywords.py."""

from __future__ import annotations

from typing import Literal, TypedDict


class Options(TypedDict, total=False):
    """Quantities are numbers in SI, or texts with a unit; `docs/reference/scenario.md` says what each key means."""

    until: float | str | None
    step: float | str
    method: Literal["nsga", "moreau", "penalty", "events"]
    spectral_radius: float | str
    theta: float | str
    position_projection: bool
    tolerance: float | str
    pile_tolerance: float | str
    tolerance_floor: float | str
    gap_tolerance: float | str
    touching_tolerance: float | str
    impact: Literal[
        "sequence",
        "sequence-paper",
        "one-shot",
        "poisson",
        "compliant",
        "binary",
    ]
    position_friction: Literal["paper", "once"]
    max_problems: int
    closing_tolerance_load: float | str
    closing_tolerance_speed: float | str
    energy_safeguard: bool
    restitution_threshold: float | str
    impact_exponent: float | str
    solver: Literal["auto", "newton"]
    max_iterations: int
    penalty_scale: float | str
    proximal_shift: float | str
    line_search: bool
    max_line_search: int
    gauss_seidel_sweeps: int
    dense_contacts: int
    pile_contacts: int
    max_halvings: int
    on_nonconvergence: Literal["stop", "warn"]
    penalty_law: Literal[
        "hunt-crossley",
        "herbert-mcwhannell",
        "lee-wang",
        "lankarani-nikravesh",
        "gonthier",
        "zhiying-qishao",
        "flores",
        "hu-guo",
        "exact",
    ]
    penalty_young_modulus: float | str
    penalty_poisson_ratio: float | str
    penalty_stiffness: float | str
    penalty_exponent: float | str
    penalty_least_restitution: float | str
    penalty_friction: Literal["regularised", "spring"]
    penalty_slip_speed: float | str
    penalty_resolution: int
    pressing_step: float | str
    threads: int
    contacts_per_thread: int
    shared_contacts_per_thread: int
    every: int | None
    contacts: bool
    impacts: bool | str
    walls: bool | None
    checkpoint_steps: int | None
    checkpoint_time: float | str | None
    checkpoint_wall: float | str | None
