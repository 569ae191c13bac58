"""Restitution that depends on the approach speed: one contact has it by every law and method, the core has the oracle's."""

import warnings
from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest
from carom import _core
from carom.audit import check
from carom.scene.tables.impact_laws import LAWS
from oracle import Reference
from oracle_scenes import nullity, random_scene
from test_oracle import difference

FORMS: list[dict[str, Any]] = [
    {"expression": "0.3 + 0.6*exp(-v)"},
    {"table": [[0.0, 0.9], [1.0, 0.7], [3.0, 0.4]]},
    {"polynomial": [0.9, -0.2, 0.02]},
]
VALUES = [
    lambda v: 0.3 + 0.6 * np.exp(-v),
    lambda v: np.interp(v, [0.0, 1.0, 3.0], [0.9, 0.7, 0.4]),
    lambda v: 0.9 - 0.2 * v + 0.02 * v**2,
]
LAW = pytest.mark.parametrize("law", LAWS)


def drop(form: Any, speed: float) -> carom.Scene:
    scene = carom.Scene(gravity=(0, 0, 0))
    scene.contact("m", "m", friction=0.0, restitution=form)
    scene.plane("floor", material="m", point=(0, 0, 0), normal=(0, 0, 1))
    scene.sphere("ball", radius=0.01, material="m", density=2500.0, position=(0, 0, 0.0105),
                 velocity=(0, 0, -speed))  # fmt: skip
    return scene


def crooked(count: int, form: Any) -> carom.Scene:
    """A chain of touching balls, the first of which hits the others."""
    rng = np.random.default_rng(1)
    ways = np.column_stack([np.ones(count - 1), 0.4 * rng.normal(size=(count - 1, 2))])
    ways *= 0.02 / np.linalg.norm(ways, axis=1, keepdims=True)
    scene = carom.Scene(gravity=(0, 0, 0))
    scene.contact("m", "m", friction=0.3, restitution=form)
    for k, x in enumerate(np.vstack([np.zeros(3), np.cumsum(ways, axis=0)])):
        scene.sphere(f"{k}", radius=0.01, material="m", density=7800.0, position=x.tolist(),
                     velocity=(2.0, 0.3, -0.2) if k == 0 else None)  # fmt: skip
    return scene


def simulated(scene: carom.Scene, **options: Any) -> carom.Result:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", carom.CaromWarning)
        return carom.simulate(scene, every=1, **options)


@LAW
@pytest.mark.parametrize("speed", [0.3, 2.5])
@pytest.mark.parametrize(("form", "value"), list(zip(FORMS, VALUES, strict=True)))
def test_one_contact_rebounds_with_its_speed_times_the_law(
    law: str, speed: float, form: Any, value: Any
) -> None:
    after = simulated(drop(form, speed), impact=law, step=1e-3, until=3e-3)["ball"].velocity[-1, 2]
    assert after == pytest.approx(value(speed) * speed, abs=1e-12)


@pytest.mark.parametrize(("method", "near"), [("moreau", 1e-12), ("events", 1e-12), ("penalty", 1e-4)])
def test_methods_share_it(method: str, near: float) -> None:
    after = simulated(drop(FORMS[0], 2.0), method=method, step=1e-3, until=3e-3)["ball"].velocity[-1, 2]
    assert after == pytest.approx(VALUES[0](2.0) * 2.0, abs=near * 2.0)


@LAW
@pytest.mark.parametrize("scenes", [20, pytest.param(300, marks=pytest.mark.long)])
def test_the_core_equals_the_oracle(law: str, scenes: int) -> None:
    """To 1e-10, but where friction is redundant: then the impulses of compression are not unique."""
    redundant = 0
    for seed in range(scenes):
        forms = [next(iter(form.items())) for form in FORMS]
        model = random_scene(seed) | {"restitution_law": [forms[seed % 3], forms[(seed + 1) % 3]]}
        model["options"]["impact"] = law
        oracle, core = Reference(model), _core.Simulation(model)
        for _ in range(4):
            oracle.advance(1)
            block = core.advance(1, 1, True, 1e9)
            assert block["outcome"] is None
            if difference(oracle, core, model["radius"]) > 1e-10:
                assert nullity(core, model, block) > 0, seed
                redundant += 1
                break
    assert redundant <= max(1, 0.025 * scenes)


def test_an_approach_that_an_impact_makes_is_clipped_to_what_restitution_can_be() -> None:
    """A heavy ball at 1 m/s drives a light one at 1.78 m/s against the next, where the law gives 1.11."""
    scene = carom.Scene(gravity=(0, 0, 0))
    scene.contact("m", "m", friction=0.0, restitution={"expression": "0.4 + 0.4*v"})
    for name, mass, x, speed in (("a", 1.0, -0.02, 1.0), ("b", 0.01, 0.0, 0.0), ("c", 0.01, 0.02, 0.0)):
        scene.sphere(name, radius=0.01, mass=mass, position=(x, 0, 0), velocity=(speed, 0, 0), material="m")
    hits = simulated(scene, step=1e-3, until=1e-3).impacts
    approach, separation = (np.asarray(hits[key])[:2] for key in ("approach", "separation"))
    np.testing.assert_allclose(approach, [-1.0, -1.8 / 1.01], rtol=1e-12)
    np.testing.assert_allclose(separation, [0.8, 1.8 / 1.01], rtol=1e-12)
    scene.spheres[0].velocity = (1.8, 0, 0)
    with pytest.raises(carom.RunFailed, match="restitution"):
        simulated(scene, step=1e-3, until=1e-3)


@LAW
def test_piles_have_it_as_rows_have_it(law: str) -> None:
    scene = crooked(30, FORMS[0])
    ends = [
        simulated(scene, impact=law, step=1e-7, until=1e-7, pile_tolerance=1e-9, pile_contacts=n).velocity[-1]
        for n in (5, 100)
    ]
    np.testing.assert_allclose(*ends, atol=2e-5)


@LAW
def test_the_auditor_has_it_in_its_own_code(law: str, tmp_path: Path) -> None:
    """It accepts the run, and of a run with another law it says so. (Through springs, of contacts that are alone.)"""
    run, scene = tmp_path / law, crooked(3, FORMS[1])
    scene.sphere("far", radius=0.01, material="m", density=7800.0, position=(0, 0.5, 0))
    scene.sphere(
        "alone", radius=0.01, material="m", density=7800.0, position=(0.0205, 0.5, 0), velocity=(-2.0, 0, 0)
    )
    simulated(scene, impact=law, step=1e-4, until=2e-3, out=run, impacts="every").close()
    report = check(run)
    assert report.ok, report
    told = run / "scenario.toml"
    text = told.read_text("utf-8")
    assert "[1.0, 0.7]" in text
    told.write_text(text.replace("[1.0, 0.7]", "[1.0, 0.75]"), "utf-8")
    assert not check(run).ok


@pytest.mark.parametrize(
    ("form", "said"),
    [
        (1.1, "must be"),
        ("1.2 - v", "at v = 0"),
        ({"table": [[0.0, 0.9], [2.0, -0.1]]}, "found -0.1 at v = 2"),
        ("0.5*t", "the variable is called v"),
    ],
)
def test_what_is_no_restitution_is_refused(form: Any, said: str) -> None:
    with pytest.raises(carom.CaromError, match=said):
        drop(form, 1.0)


def test_a_speed_at_which_it_is_none_ends_the_run() -> None:
    with pytest.raises(carom.CaromError, match=r"e_N = -0.6 at an approach of 3.*min\(1, ...\)"):
        simulated(drop({"polynomial": [0.9, -0.5]}, 3.0), step=1e-3, until=3e-3)


def test_a_number_takes_the_place_of_the_law_in_a_batch() -> None:
    batch = carom.simulate_batch(drop(FORMS[0], 2.0), {"m/m.restitution": [0.5, 0.25]}, step=1e-3, until=3e-3)
    assert batch.velocity[:, 0, 2] == pytest.approx([1.0, 0.5])
