"""A stand-in for `carom._core` where the extension is not built: the options that the scenario model asks for.

    PYTHONPATH=python:tests pytest -p fake_core tests/test_scenario*.py

puts it into `sys.modules` if the real module cannot be imported. It simulates nothing.
"""

from __future__ import annotations

import importlib
import sys
import types


def defaults() -> dict[str, float | int | bool | str]:
    return {
        "step": 1e-3,
        "spectral_radius": 0.8,
        "tolerance": 1e-8,
        "method": "nsga",
        "impact": "sequence",
        "solver": "auto",
        "threads": 1,
        "max_iterations": 50,
        "penalty_scale": 0.5,
        "tolerance_floor": 1e-12,
        "gap_tolerance": 1e-10,
        "touching_tolerance": 1e-9,
        "proximal_shift": 1e-4,
        "line_search": True,
        "max_line_search": 10,
        "max_problems": 50,
        "closing_tolerance_load": 1e-2,
        "closing_tolerance_speed": 1e-6,
        "energy_safeguard": True,
        "restitution_threshold": 0.0,
        "dense_contacts": 10,
        "gauss_seidel_sweeps": 15,
        "max_halvings": 4,
        "on_nonconvergence": "stop",
    }


def choices() -> dict[str, list[str]]:
    return {
        "method": ["nsga", "moreau", "penalty"],
        "impact": ["sequence", "sequence-paper", "one-shot"],
        "solver": ["auto", "newton", "gauss-seidel"],
        "on_nonconvergence": ["stop", "warn"],
    }


def install() -> bool:
    """True if the fake is in use."""
    try:
        core = importlib.import_module("carom._core")
    except ImportError:
        fake = types.ModuleType("carom._core")
        fake.__dict__.update(defaults=defaults, choices=choices, FAKE=True)
        sys.modules["carom._core"] = fake
        return True
    return bool(getattr(core, "FAKE", False))


install()
