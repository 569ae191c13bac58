"""Poisson's law as the auditor judges it: what several impulses of compression, or rule R4, leave open is no fault."""

from __future__ import annotations

import carom
import pytest


def grains(shape: str, seed: int, count: int, friction: float) -> carom.Scene:
    scene = carom.Scene("grains", gravity=(0, 0, -9.8))
    scene.contact("a", "a", friction=friction, restitution=0.3)
    scene.contact("a", "w", friction=friction, restitution=0.3)
    if shape == "silo":
        sizes = {"sizes": "uniform", "smallest": 0.004, "largest": 0.016}
        region = {
            "region": "cylinder",
            "point": (0, 0, 0.1),
            "axis": (0, 0, 1),
            "region_radius": 0.03,
            "length": 0.16,
        }
        scene.packing("p", material="a", density=2500, seed=seed, count=count, **region, **sizes)
        scene.cone(
            "k", material="w", point=(0, 0, 0), axis=(0, 0, 1), radius=0.016, radius_end=0.03, length=0.02
        )
        scene.cylinder("t", material="w", point=(0, 0, 0.12), axis=(0, 0, 1), radius=0.03, length=0.2)
        scene.outlet(low=(-1, -1, -9), high=(1, 1, -0.05))
        return scene
    low, high = (0, 0, 0), (0.05, 0.05, 0.15)
    scene.packing("p", material="a", density=2500, seed=seed, count=count, low=low, high=high, diameter=0.01)
    scene.box("b", material="w", low=low, high=high, open=["high_z"])
    return scene


def test_an_expansion_that_the_safeguard_took_back_is_not_missed() -> None:
    """Loads hold a ball that came in slowly: any expansion is a gain, and without impulse there is no row to say so."""
    report = carom.audit.check(
        carom.simulate(grains("silo", 32, 60, 0.0), step=1e-3, until=0.2, impact="poisson")
    )
    assert report.ok, report.findings
    assert report["impact"].judged > 100


def test_impulses_of_compression_far_apart_are_no_fault() -> None:
    """Three balls that friction wedges have several, each unique nearby."""
    result = carom.simulate(grains("box", 3, 30, 1.0), step=2e-3, until=0.17, impact="poisson")
    report = carom.audit.check(result)
    assert report.ok, report.findings
    assert any("not unique" in left.why for left in report["impact"].unjudged)


@pytest.mark.parametrize(
    ("law", "words"), [("poisson", "Poisson's"), ("sequence", "Newton's"), ("binary", "springs")]
)
def test_the_report_names_the_law_of_the_run(law: str, words: str) -> None:
    scene = carom.Scene("one", gravity=(0, 0, -9.8))
    scene.contact("a", "a", friction=0.1, restitution=0.3)
    scene.plane("f", material="a", point=(0, 0, 0), normal=(0, 0, 1))
    scene.sphere("b", material="a", radius=0.01, mass=0.01, at=(0, 0, 0.011))
    report = carom.audit.check(carom.simulate(scene, step=1e-3, until=0.05, impact=law))
    assert words in report["impact"].kind.law
