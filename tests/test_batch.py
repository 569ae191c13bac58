"""`carom.simulate_batch`: the bits of single runs, failures of their own, names that are checked."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest
from carom import CaromError, ScenarioError
from carom.many.cases import Overrides
from carom.many.threads import Runner
from carom.numeric import reals
from carom.scene.tables.model import Contact

ROOT = Path(__file__).parent.parent
BREAK = ROOT / "scenarios" / "paper" / "5.6_break.toml"
STATE = ("position", "orientation", "velocity", "angular_velocity")

pytestmark = pytest.mark.filterwarnings("ignore::carom.CaromWarning")


def pair(until: float = 0.05) -> carom.Scene:
    """A ball that slides towards another one, on a table."""
    scene = carom.Scene("two balls", run={"until": until, "step": 1e-3})
    for name, x in (("cue", 0.0), ("object", 0.08)):
        scene.sphere(name, radius=0.028575, mass=0.17, at=(x, 0.0, 0.028575), material="ball")
    scene.spheres[0].velocity = (2.0, 0.0, 0.0)
    scene.plane("bed", point=(0, 0, 0), normal=(0, 0, 1), material="cloth")
    scene.contact("ball", "ball", friction={"expression": "0.01 + 0.1*exp(-v)"}, restitution=0.93)
    scene.contact("ball", "cloth", friction=0.2, restitution=0.0)
    return scene


def test_cases_have_the_bits_of_single_runs_on_any_number_of_threads() -> None:
    speeds, spins = [8.0, 10.729, 12.0], [0.0, 40.0, -40.0]
    given = {
        "ball2.velocity.x": speeds,
        "ball2.angular_velocity.z": spins,
        "ball/ball.friction": [0.0, 0.06, 0.1],
    }
    two = carom.simulate_batch(BREAK, given, threads=2, until=0.5)
    one = carom.simulate_batch(BREAK, given, threads=1, until=0.5, frames=100, impacts=True)
    assert two.ok.all()
    assert two.position.shape == (3, 4, 3)
    for case in range(3):
        result = carom.simulate(two.scene(case), every=100)
        for key in STATE:
            single = np.asarray(getattr(result, key))
            assert np.array_equal(getattr(two, key)[case], single[-1])
            assert np.array_equal(getattr(one, key)[case], single[-1])
            assert np.array_equal(one.frames[key][case], single)
        assert np.array_equal(one.frame_time, np.asarray(result.time))
        mine = one.impacts["case"] == case
        assert np.array_equal(one.impacts["impulse"][mine], np.asarray(result.impacts["impulse"]))
        assert two.monitors["penetration_max"][case] == result.summary["penetration_max"]
    assert len(np.unique(two["ball3"].velocity[:, 0])) == 3
    assert not two.impacts
    assert two.per_second > 0


def test_the_scene_of_a_case_without_overrides_is_the_scene() -> None:
    batch = carom.simulate_batch(pair())
    assert len(batch) == 1
    result = carom.simulate(pair())
    assert np.array_equal(batch.position[0], np.asarray(result.position)[-1])


def test_failures_stay_with_their_case() -> None:
    x = [0.0, 0.05, np.nan, -0.1]
    batch = carom.simulate_batch(pair(), {"cue.position.x": x, "cue.mass": [0.17, 0.17, 0.17, -1.0]})
    assert batch.outcome.tolist() == ["done", "overlap", "bad_model", "bad_model"]
    assert "cue and object overlap by 0.0272" in batch.message[1]
    low = carom.simulate_batch(pair(), {"cue.position.z": [0.02]})
    assert "cue and bed overlap" in low.message[0]
    assert "position" in batch.message[2]
    assert batch.ok.tolist() == [True, False, False, False]
    assert np.isfinite(batch.position[0]).all()
    assert np.isnan(batch.position[1:]).all()
    assert "3 failed" in repr(batch)


def test_a_step_that_cannot_be_made_is_a_failure_of_its_case() -> None:
    scene = pair()
    scene._tree.contact[0].friction = {"expression": "1 - v"}  # below zero for the faster one
    given = {"cue.velocity.x": [0.5, 3.0, 0.7], "cue.angular_velocity.z": [0.0, 100.0, 0.0]}
    batch = carom.simulate_batch(scene, given)
    assert batch.outcome.tolist() == ["done", "friction_failed", "done"]
    assert "at step" in batch.message[1]
    with pytest.raises(carom.RunFailed) as caught:
        carom.simulate(batch.scene(1))
    assert f"at step {caught.value.result.outcome.step}," in batch.message[1]


def test_mass_and_radius_keep_the_kind_of_ball() -> None:
    scene = pair()
    batch = carom.simulate_batch(scene, {"cue.mass": [0.17, 0.34]})
    heavy = batch.scene(1).spheres[0]
    assert heavy.inertia == pytest.approx(0.4 * 0.34 * 0.028575**2, rel=1e-15)
    own = carom.simulate_batch(scene, {"cue.mass": [0.34], "cue.inertia": [1e-4]})
    assert own.scene(0).spheres[0].inertia == 1e-4
    # Momentum at the end of a collision of 2:1, frictionless table aside: the heavy ball goes on.
    assert batch["cue"].velocity[1, 0] > batch["cue"].velocity[0, 0] + 0.3


def test_a_number_takes_the_place_of_a_law_of_friction() -> None:
    batch = carom.simulate_batch(pair(), {"ball/ball.friction": [0.0, 0.5]})
    single = carom.simulate(batch.scene(1))
    assert batch.scene(0)._tree.contact[0].friction == 0.0
    assert np.array_equal(batch.angular_velocity[1], np.asarray(single.angular_velocity)[-1])
    assert not np.array_equal(batch.angular_velocity[0], batch.angular_velocity[1])


def test_a_list_of_scenes() -> None:
    fast = pair()
    fast.spheres[0].velocity = (3.0, 0.0, 0.0)
    bad = pair()
    bad.spheres[0].position = (0.05, 0.0, 0.028575)
    batch = carom.simulate_batch([pair(), fast, bad], until=0.02)
    assert batch.outcome.tolist() == ["done", "done", "bad_scene"]
    assert "overlap" in batch.message[2]
    assert np.array_equal(batch.position[1], np.asarray(carom.simulate(fast, until=0.02).position)[-1])
    other = carom.Scene(run={"until": 1})
    other.sphere("x", radius=1, mass=1, at=(0, 0, 0), material="m")
    with pytest.raises(CaromError, match="other balls"):
        carom.simulate_batch([pair(), other])


def test_columns_are_one_row_per_case() -> None:
    batch = carom.simulate_batch(pair(), {"cue.velocity": [[1.0, 0, 0], [2.0, 0, 0]]})
    table = batch.columns()
    assert {len(values) for values in table.values()} == {2}
    assert table["parameter cue.velocity.x"].tolist() == [1.0, 2.0]
    assert table["object.velocity.x"][1] == batch["object"].velocity[1, 0]
    of_all = {
        "velocity": np.arange(12.0).reshape(2, 2, 3),
        "cue.mass": [0.1, 0.2],
        "gravity": np.zeros((2, 3)),
    }
    wide = carom.simulate_batch(pair(0.002), of_all).columns()
    assert wide["parameter velocity.object.y"].tolist() == [4.0, 10.0]
    assert wide["parameter cue.mass"].tolist() == [0.1, 0.2]
    assert wide["parameter gravity.z"].tolist() == [0.0, 0.0]
    pytest.importorskip("pandas", reason="the extra [interop] is not installed")
    frame = batch.to_pandas()
    assert list(frame) == list(batch.columns())
    for name, column in batch.columns().items():
        np.testing.assert_array_equal(frame[name].to_numpy(), column)


def sticky() -> carom.Scene:
    """Two balls a hair apart, of a law without cohesion."""
    scene = carom.Scene(gravity=(0, 0, 0), run={"until": 0.02, "step": 5e-4})
    scene.contact("grain", "grain", friction=0.4, restitution=0.3)
    for k in range(2):
        scene.sphere(f"b{k}", material="grain", radius=2.5e-3, density=2500, position=(5.02e-3 * k, 0, 0),
                     velocity=(1e-3 * k, 0, 0))  # fmt: skip
    return scene


@pytest.mark.parametrize(
    ("values", "told"),
    [
        (np.ma.array([1.0, 2.0], mask=[False, True]), "some of them are masked"),
        ([np.ma.masked, 1.0], "some of them are masked"),
        ([True, False], "found true"),
        (np.array([True, False]), "found true"),
        ([1.0, True], "found true"),
        (["1.0", "2.0"], 'found "1.0"'),
        ([1j, 2.0], "found 1j"),
        ([None, 2.0], "found nothing"),
        ([10**400], "one of them is too large"),
    ],
)
def test_what_is_no_number_is_refused(values: Any, told: str) -> None:
    """Masks were forgotten, true was 1, and so was a text."""
    with pytest.raises(CaromError, match=rf'"cue.velocity.x" must be numbers in SI \({told}'):
        carom.simulate_batch(pair(), {"cue.velocity.x": values})
    with pytest.raises(CaromError, match=r"^parameters.v: "):
        carom.Study.of(BREAK, {"v": values}, set={"ball2.velocity.x": "= v"}, until=0.1)


def test_numbers_may_be_arrays_without_axes() -> None:
    """As results of NumPy are: they were refused in lists."""
    for values in ([np.array(1.0), np.array(2)], [np.float32(1.0), np.int8(2)], [1.0, np.array(2.0)]):
        np.testing.assert_array_equal(reals(values), [1.0, 2.0])
    for wrong, told in ((np.array(True), "true"), (np.array("1.0"), '"1.0"'), (np.array(1j), "1j")):
        with pytest.raises(ValueError, match=f"^found {told}$"):
            reals([1.0, wrong])


@pytest.mark.parametrize("key", ["every", "contacts", "walls", "checkpoint_wall"])
def test_what_a_batch_does_not_record_is_refused(key: str) -> None:
    """Nothing was done with such keys, without a word."""
    cure = "frames=10 records every tenth step" if key == "every" else "leave it out"
    with pytest.raises(CaromError, match=f"^simulate_batch: {key} does nothing here; {cure}$"):
        carom.simulate_batch(pair(), **{key: 1})
    with pytest.raises(CaromError, match=f"^sensitivity: {key} does nothing here; leave it out$"):
        carom.sensitivity(pair(), ["cue.velocity.x"], **{key: 1})


def test_every_number_of_a_contact_law_varies() -> None:
    """Those of cohesion were refused."""
    batch = carom.simulate_batch(
        sticky(),
        {"grain/grain.cohesion": [0.0, 1e-3, 1e-3], "grain/grain.rupture_distance": [0.0, 1e-4, 0.0]},
    )
    assert batch.outcome.tolist() == ["done", "done", "bad_model"]
    assert "rupture_distance of contact law 0" in batch.message[2]
    assert batch.position[1, 1, 0] < batch.position[0, 1, 0]
    for case in range(2):
        scene = carom.Scene.from_toml(batch.scene(case).to_toml())
        assert np.array_equal(carom.simulate(scene).position[-1], batch.position[case])
    for key in Contact.model_fields.keys() - {"between"}:
        assert Overrides(sticky(), {f"grain/grain.{key}": [0.5]}).cases == 1


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"cue.velcity": [[1.0, 0, 0]]}, "did you mean velocity"),
        ({"cu.velocity": [[1.0, 0, 0]]}, "did you mean cue"),
        ({"cue.velocity": [1.0, 2.0]}, r"wanted \(B, 3\)"),
        ({"cue.mass": [[1.0]]}, r"wanted \(B,\)"),
        ({"cue.mass": ["heavy"]}, "numbers in SI"),
        ({"cue.mass.x": [1.0]}, "has no x"),
        ({"cue.mass": [1.0], "object.mass": [1.0, 2.0]}, "one row per case"),
        ({"cue.mass": []}, "no rows"),
        ({"cue.velocity": [[1.0, 0, 0]], "cue.velocity.x": [1.0]}, "both give the same numbers"),
        ({"ball/glass.friction": [1.0]}, "known: ball/ball, ball/cloth"),
        ({"ball/cloth.frictions": [1.0]}, "did you mean friction"),
        ({"velocity": np.zeros((1, 3, 3))}, r"wanted \(B, 2, 3\)"),
    ],
)
def test_wrong_names_and_shapes_are_told(given: dict[str, object], said: str) -> None:
    with pytest.raises(CaromError, match=said):
        carom.simulate_batch(pair(), given)  # type: ignore[arg-type]


def test_wrong_arguments_are_told() -> None:
    with pytest.raises(CaromError, match="threads"):
        carom.simulate_batch(pair(), threads=0)
    with pytest.raises(CaromError, match="frames"):
        carom.simulate_batch(pair(), frames=0)
    with pytest.raises(CaromError, match="until"):
        carom.simulate_batch(carom.Scene())
    with pytest.raises(ScenarioError):
        carom.simulate_batch(pair(), untl=3)
    with pytest.raises(CaromError, match="empty"):
        carom.simulate_batch([])
    with pytest.raises(CaromError, match="found list"):
        carom.simulate_batch(pair(), [1.0, 2.0])  # type: ignore[arg-type]
    with pytest.raises(CaromError, match="need one step"):  # their frames are at other times
        carom.simulate_batch([pair(), pair().with_options(step=5e-4)], frames=10)
    with pytest.raises(CaromError, match="GiB"):
        carom.simulate_batch(pair(until=1e5), frames=1)


def test_what_stops_a_batch_keeps_what_is_done() -> None:
    def progress(done: int, cases: int) -> None:
        if done:
            raise RuntimeError("enough")

    speeds = np.linspace(0.5, 2.0, 400)
    with pytest.raises(RuntimeError, match="enough") as caught:
        carom.simulate_batch(BREAK, {"ball2.velocity.x": speeds}, threads=1, progress=progress)
    batch = caught.value.result  # type: ignore[attr-defined]
    assert 0 < batch.ok.sum() < 400
    assert set(batch.outcome) == {"done", "not_run"}
    done = int(batch.ok.sum())
    assert f", {400 - done} not run;" in repr(batch)
    assert batch.per_second == done / batch.wall_s


def test_progress_ends_with_all_cases() -> None:
    told: list[tuple[int, int]] = []
    for _ in range(5):  # the last worker may end between two looks
        given = {"cue.velocity.x": [0.1, 0.2, 0.3]}
        carom.simulate_batch(pair(0.002), given, threads=2, progress=lambda *n: told.append(n))
        assert told[-1] == (3, 3)


def test_batches_are_themselves_and_name_the_cases_they_have() -> None:
    batch = carom.simulate_batch(pair(0.002), {"cue.velocity.x": [0.1, 0.2]})
    assert batch == batch
    assert batch != carom.simulate_batch(pair(0.002), {"cue.velocity.x": [0.1, 0.2]})
    assert batch.scene(-1).spheres[0].velocity == (0.2, 0.0, 0.0)
    with pytest.raises(IndexError, match="there are 2"):
        batch.scene(2)


def test_a_load_function_keeps_its_place_in_a_case_and_a_batch_that_breaks_keeps_its_cases(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def push(t: float, x: object, v: object, w: object) -> np.ndarray:
        return np.array([[0.3, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, 0]])

    scene = pair()
    scene.load_function(push)
    batch = carom.simulate_batch(scene, {"cue.mass": [0.17, 0.2]})
    single = carom.simulate(batch.scene(1))
    assert np.array_equal(batch.position[1], np.asarray(single.position)[-1])

    keep = Runner._keep

    def fault(runner: Runner, case: int, *rest: object) -> None:
        if case == 1:
            raise RuntimeError("a fault of Carom")
        keep(runner, case, *rest)  # type: ignore[arg-type]

    monkeypatch.setattr(Runner, "_keep", fault)
    with pytest.raises(RuntimeError, match="a fault of Carom") as caught:
        carom.simulate_batch(pair(), {"cue.mass": [0.17, 0.2, 0.3]}, threads=1)
    assert caught.value.result.outcome.tolist() == ["done", "not_run", "not_run"]  # type: ignore[attr-defined]


def test_a_ball_may_be_called_as_two_materials() -> None:
    """The law `ball/cloth.friction` was refused then, with the advice to write just that."""
    plain, scene = pair(), pair()
    scene.spheres[1].name = "ball/cloth"
    given = {"ball/cloth.friction": [0.0, 0.3]}
    found = carom.simulate_batch(scene, given | {"ball/cloth.mass": [0.1, 0.2]})
    same = carom.simulate_batch(plain, given | {"object.mass": [0.1, 0.2]})
    assert np.array_equal(found.position, same.position)
