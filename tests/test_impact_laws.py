"""Every law of the table of impact laws keeps what its row promises, and everybody who asks the table finds it."""

import warnings
from pathlib import Path

import carom
import numpy as np
import pytest
from carom import _core
from carom.audit import check
from carom.reproduce.citations import SOURCES, sources
from carom.scene.tables.impact_laws import LAWS
from carom.scene.tables.model import Contact

LAW = pytest.mark.parametrize("law", LAWS)


def balls(mu: float, e: float, law: str, *, e_t: float = 0.0) -> carom.Scene:
    """Bernoulli's problem: a ball hits two that touch, all three at once."""
    scene = carom.Scene(gravity=(0, 0, 0))
    scene.material("m")
    scene.contact("m", "m", friction=mu, restitution=e, tangential_restitution=e_t)
    s = 0.02 * np.sqrt(3.0) / 2
    scene.sphere("a", radius=0.01, material="m", density=7800.0, position=(-s, 0, 0), velocity=(1.0, 0, 0))
    scene.sphere("b", radius=0.01, material="m", density=7800.0, position=(0, 0.01, 0))
    scene.sphere("c", radius=0.01, material="m", density=7800.0, position=(0, -0.01, 0))
    return scene.with_options(impact=law, until=2e-3, step=1e-4)


def simulated(scene: carom.Scene, **options: object) -> carom.Result:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", carom.CaromWarning)
        return carom.simulate(scene, every=1, **options)


def test_the_table_has_every_law() -> None:
    assert list(LAWS) == _core.choices()["impact"]


@LAW
def test_a_row_names_what_there_is(law: str) -> None:
    row = LAWS[law]
    assert row.summary
    assert row.advice
    assert set(row.needs) <= set(Contact.model_fields)
    assert set(row.cite) <= set(SOURCES)
    cited = sources(balls(0.0, 1.0, law))
    assert set(row.cite) <= set(cited)
    assert not {key for other in LAWS.values() for key in other.cite} - set(row.cite) & set(cited)


@LAW
@pytest.mark.parametrize("e", [0.0, 0.4, 1.0])
def test_one_contact_has_the_restitution_of_its_material(law: str, e: float) -> None:
    """And gravity does not add to it: restitution acts on the velocity before the step."""
    scene = carom.Scene(gravity=(0, 0, -9.81))
    scene.material("m")
    scene.contact("m", "m", friction=0.0, restitution=e)
    scene.plane("floor", material="m", point=(0, 0, 0), normal=(0, 0, 1))
    scene.sphere(
        "ball", radius=0.01, material="m", density=2500.0, position=(0, 0, 0.0105), velocity=(0, 0, -1.0)
    )
    result = simulated(scene, impact=law, until=1e-3, step=1e-3)
    assert result["ball"].velocity[-1, 2] == pytest.approx(e * 1.0, abs=1e-12)


@LAW
@pytest.mark.parametrize("mu", [0.0, 0.06])
def test_energy_is_what_the_row_says(law: str, mu: float) -> None:
    """With friction Newton's law gains energy in this impact (Kane) where nothing takes it back."""
    result = simulated(balls(mu, 1.0, law))
    gained = float(result.energy.total.max()) / (0.5 * float(result.bodies["mass"][0]) * 1.0**2) - 1.0
    assert np.abs((result.bodies["mass"][:, None] * result.velocity[-1]).sum(axis=0)[1:]).max() < 1e-12
    if LAWS[law].energy:
        assert gained <= 1e-10
    elif mu > 0.0:
        assert gained > 1e-3


@LAW
def test_the_auditor_accepts_its_runs(law: str, tmp_path: Path) -> None:
    run = tmp_path / law
    simulated(balls(0.3, 0.7, law, e_t=0.3), out=run, impacts="every").close()
    report = check(run)
    assert report.ok, report
    found = carom.load(run).impacts
    assert len(found) > 0
    assert LAWS[law].problems == 0 or np.max(found["problem"]) <= LAWS[law].problems
