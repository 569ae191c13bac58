"""`impacts = "history"`: how the impulse of each pair grows within an impact, by every law."""

from pathlib import Path

import carom
import numpy as np
import pytest
from carom.audit import check
from carom.scene.chains import chain, cradle
from carom.scene.scene import Scene
from carom.scene.tables.impact_laws import LAWS
from test_impact_laws import balls, simulated

LAW = pytest.mark.parametrize("law", LAWS)


def curves(result: carom.Result) -> dict[tuple[int, int, int], np.ndarray]:
    """Of each step and pair: (K, 2) where in the impact, and the impulse so far."""
    table = result.impulses
    keys = np.column_stack([table["step"], np.asarray(table["body"])])
    points = np.column_stack([table["at"], table["impulse"]])
    return {tuple(key): points[(keys == key).all(axis=1)] for key in np.unique(keys, axis=0).tolist()}


@LAW
@pytest.mark.parametrize(
    "scene", [chain(4, restitution=0.8), balls(0.3, 0.7, "one-shot", e_t=0.3), cradle(3, hits=1)]
)
def test_its_ends_are_the_sums_of_the_table_of_impacts(law: str, scene: Scene) -> None:
    result = simulated(scene, impact=law, impacts="history")
    found, impacts = curves(result), result.impacts
    given = np.einsum("ij,ij->i", impacts["normal"], impacts["impulse"])
    acts = np.asarray(impacts["problem"]) > 0
    keys = np.column_stack([impacts["step"], np.asarray(impacts["body"])])
    size = float(np.abs(given).max())
    assert acts.any()
    for key, points in found.items():
        rows = acts & (keys == key).all(axis=1)
        assert points[-1, 1] == pytest.approx(given[rows].sum(), abs=1e-12 * size)
        assert points[-1, 0] == impacts["problem"][rows].max()
        assert (np.diff(points[:, 0]) > 0.0).all()
        assert np.diff(points[:, 1]).min(initial=0.0) >= -1e-9 * size
    assert {tuple(key) for key in keys[acts].tolist()} == set(found)


@pytest.mark.parametrize("law", ["compliant", "binary"])
@pytest.mark.parametrize("count", [3, 10])
def test_a_pulse_runs_through_a_row(count: int, law: str) -> None:
    """Contacts begin one after the other, the first at once, and each has a curve of its own."""
    found = curves(simulated(chain(count), impact=law, impacts="history"))
    begins = [found[(1, k, k + 1)][0, 0] for k in range(count - 1)]
    assert begins[0] == 0.0
    assert (np.diff(begins) > 0.0).all()
    assert min(len(points) for points in found.values()) > 50


def test_impulses_of_a_row_are_the_momentum_that_has_passed() -> None:
    result = simulated(chain(5), impact="compliant", impacts="history")
    momentum = result.bodies["mass"] * result.velocity[-1][:, 0]
    found = curves(result)
    assert [found[(1, k, k + 1)][-1, 1] for k in range(4)] == pytest.approx(
        np.cumsum(momentum[::-1])[::-1][1:], rel=1e-12
    )


def test_a_file_has_it_and_the_auditor_accepts_it(tmp_path: Path) -> None:
    scene = chain(4, restitution=0.8)
    simulated(scene, impact="binary", impacts="history", out=tmp_path / "run").close()
    kept = simulated(scene, impact="binary", impacts="history").impulses
    read = carom.load(tmp_path / "run").impulses
    assert len(kept) > 100
    for name in ("step", "time", "body", "at", "impulse"):
        np.testing.assert_array_equal(kept[name], read[name])
    assert len(read.between("1", "2")) > 50
    assert check(tmp_path / "run").ok
    assert len(simulated(scene, impact="binary").impulses) == 0
