"""Every law of the table of impact laws keeps what its row promises, and everybody who asks the table finds it."""

import importlib.util
import re
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest
from carom import _core
from carom.audit import check
from carom.cli.app import app
from carom.reproduce.citations import SOURCES, sources
from carom.scene.chains import chain, column, cradle
from carom.scene.tables.impact_laws import LAWS
from carom.scene.tables.model import Contact
from joint_scenes import rod
from oracle import Reference
from oracle_scenes import nullity, random_linked_scene, random_scene
from test_oracle import difference
from typer.testing import CliRunner

ROOT = Path(__file__).parent.parent

LAW = pytest.mark.parametrize("law", LAWS)
LAW_OF_SPEED: dict[str, Any] = {"friction": 0.0, "restitution": {"table": [[0, 1], [1, 0.5], [2, 0]]}}


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


def random_hung_scene(seed: int) -> dict[str, Any]:
    """Some balls hang on rods."""
    rng, model = np.random.default_rng(seed), random_scene(seed)
    x, v, joints = model["position"], model["velocity"].copy(), []
    for a in range(len(x)):
        way = rng.normal(size=3)
        way /= np.linalg.norm(way)
        if rng.random() < 0.5:
            joints.append(rod(x, a, -1, x[a], x[a] + 0.3 * way))
            v[a] -= way * (way @ v[a])
    return model | {"joints": joints, "velocity": v}


def simulated(scene: carom.Scene, **options: Any) -> carom.Result:
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
@pytest.mark.parametrize(
    ("mu", "spin", "sticks"),
    [(0.1, 0.0, False), (0.5, 0.0, True), (0.1, -400.0, False), (0.9, -200.0, True), (0.2, 600.0, False)],
)
def test_an_oblique_ball_on_a_wall_has_its_closed_form(
    law: str, mu: float, spin: float, sticks: bool
) -> None:
    """It slips to the end, or until it sticks; backspin turns it round, forward spin drives it on. `e_T = 0`."""
    e, r, down, along = 0.8, 0.01, 2.0, np.array([0.9, 1.2])
    scene = carom.Scene(gravity=(0, 0, 0))
    scene.contact("m", "m", friction=mu, restitution=e)
    scene.plane("wall", material="m", point=(0, 0, 0), normal=(0, 0, 1))
    way = along / np.linalg.norm(along)
    axis = np.array([-way[1], way[0], 0.0])  # turning about it positively rolls along the way
    scene.sphere("b", radius=r, material="m", mass=1.0, position=(0, 0, r), velocity=(*along, -down),
                 angular_velocity=(spin * axis).tolist())  # fmt: skip
    end = simulated(scene, impact=law, step=1e-9, until=1e-9)
    slip = float(along @ way) - r * spin
    impulse = -np.sign(slip) * min(mu * (1 + e) * down, abs(slip) / 3.5)
    assert (abs(slip) / 3.5 < mu * (1 + e) * down) == sticks
    after = [*(along + impulse * way), e * down]
    assert end.velocity[-1][0] == pytest.approx(after, abs=1e-9)
    assert end.angular_velocity[-1][0] == pytest.approx((spin - 2.5 * impulse / r) * axis, abs=1e-7)


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


# ---------------------------------------------------------------------------------------------- other laws than Newton's


def dumbbell(
    kind: str, tilt: float = 0.0, /, v: Any = (0.3, 0.1, -1.0), w: Any = (5.0, 3.0, 1.0), **contact: Any
) -> carom.Scene:
    """Two balls as one body that lands on a floor: tied by joints, or a clump of the same mass and inertia."""
    r, m = 0.01, 0.1
    scene, arm = carom.Scene(gravity=(0, 0, 0)), r * np.array([np.cos(tilt), 0, np.sin(tilt)])
    centre = np.array([0, 0, r + abs(arm[2]) + 1e-12])
    for other in ("floor", "ball"):
        scene.contact("ball", other, **contact)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="floor")
    if kind == "clump":
        spheres, own = [[-r, 0, 0, r], [r, 0, 0, r]], 0.8 * m * r**2
        turn = (np.cos(tilt / 2), 0, -np.sin(tilt / 2), 0)
        moments = {
            "inertia": [own, own + 2 * m * r**2, own + 2 * m * r**2],
            "centre": [0, 0, 0],
            "mass": 2 * m,
        }
        motion = {"position": centre, "orientation": turn, "velocity": v, "angular_velocity": w}
        scene.clump("a", spheres=spheres, material="ball", **moments, **motion)
        return scene
    for name, x in (("a", arm), ("b", -arm)):
        motion = {"position": centre + x, "velocity": v + np.cross(w, x), "angular_velocity": w}
        scene.sphere(name, radius=r, mass=m, material="ball", **motion)
    scene.joint("ball", between=["a", "b"], point=centre)
    scene.joint("lock", between=["a", "b"])
    return scene


@pytest.mark.parametrize("tilt", [0.0, 0.5])
@pytest.mark.parametrize(
    "contact", [{"friction": 0.3, "tangential_restitution": 0.3, "restitution": 0.6}, LAW_OF_SPEED]
)
def test_balls_that_joints_make_one_body_rebound_by_poissons_law_as_a_clump(
    contact: dict[str, Any], tilt: float
) -> None:
    """Inverse masses of e_N(v) and e_T are those that joints leave."""
    runs = [
        simulated(dumbbell(kind, tilt, **contact), step=1e-6, until=3e-6, impact="poisson")
        for kind in ("clump", "tied")
    ]
    clump, tied = (run.velocity[-1].mean(axis=0) for run in runs)
    assert np.abs(clump - tied).max() < 1e-6


@pytest.mark.parametrize("law", ["poisson", "compliant", "binary"])
@pytest.mark.parametrize("seed", range(6))
def test_balls_that_joints_make_one_body_land_flat_as_a_clump(law: str, seed: int) -> None:
    """Slips of both balls along the line of centres are one. By what a step breaks of joints they were not, and friction
    never settled: no rebound."""
    rng = np.random.default_rng(seed)
    motion = {"v": np.array([*rng.uniform(-0.3, 0.3, 2), -1.0]), "w": rng.uniform(-5, 5, 3)}
    contact = {"friction": 0.3, "restitution": 0.6}
    scenes = [dumbbell(kind, **motion, **contact) for kind in ("clump", "tied")]
    clump, tied = (simulated(scene, step=1e-6, until=3e-6, impact=law) for scene in scenes)
    assert tied.summary["fallbacks"] == 0
    assert np.abs(clump.velocity[-1].mean(axis=0) - tied.velocity[-1].mean(axis=0)).max() < 1e-6


@pytest.mark.parametrize("law", ["sequence", "one-shot", "poisson", "compliant", "binary"])
@pytest.mark.parametrize("angle", [0.0, 30.0, 45.0, 60.0])
def test_a_ball_on_a_line_has_the_restitution_of_its_approach(law: str, angle: float) -> None:
    a = np.radians(angle)
    way = np.array([np.sin(a), 0, -np.cos(a)])
    scene = carom.Scene(gravity=(0, 0, 0))
    scene.contact("ball", "floor", **LAW_OF_SPEED)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="floor")
    scene.sphere("ball", radius=0.01, mass=0.1, material="ball", position=(0, 0, 0.01), velocity=way)
    scene.joint("line", body="ball", direction=way)
    scene.joint("lock", body="ball")
    result = simulated(scene, step=1e-6, until=3e-6, impact=law)
    assert result.velocity[-1][0] @ way == pytest.approx(-(1 - 0.5 * np.cos(a)), abs=1e-8)


@pytest.mark.parametrize(
    ("law", "make"),
    [
        *((law, random_scene) for law in LAWS),
        ("poisson", random_linked_scene),
        ("compliant", random_hung_scene),
        ("binary", random_hung_scene),
        ("compliant", random_linked_scene),
        ("binary", random_linked_scene),
    ],
)
@pytest.mark.parametrize("scenes", [40, pytest.param(300, marks=pytest.mark.long)])
def test_every_law_equals_the_oracle(law: str, make: Callable[[int], dict[str, Any]], scenes: int) -> None:
    """To 1e-10, but where friction is redundant: then the impulses of compression are not unique."""
    redundant = 0
    for seed in range(scenes):
        model = make(seed)
        model["options"]["impact"] = law
        oracle, core = Reference(model), _core.Simulation(model)
        for _ in range(5):
            oracle.advance(1)
            block = core.advance(1, 1, True, 1e9)
            assert block["outcome"] is None
            if difference(oracle, core, model["radius"]) > 1e-10:
                assert nullity(core, model, block) > 0, seed
                redundant += 1
                break
    assert redundant <= 0.025 * scenes


@LAW
def test_names_change_nothing_cones_hold_and_energy_never_grows(law: str) -> None:
    """300 clusters of up to 14 balls with friction; their contacts turn round and come in another order.

    Where friction is redundant the impulses of compression are not unique, and Poisson's rebound follows them. A gain of
    1e-10 of the energy is rounding by rule R4.
    """
    bodies = (
        "radius",
        "mass",
        "inertia",
        "position",
        "orientation",
        "velocity",
        "angular_velocity",
        "material",
    )
    several = redundant = 0
    for seed in range(300):
        model = random_scene(seed, 14)
        model["options"] |= {"impact": law, "position_friction": "once"}
        order = np.random.default_rng(seed).permutation(len(model["radius"]))
        core = _core.Simulation(model)
        block = core.advance(5, 1, True, 1e9)
        renamed = _core.Simulation(model | {name: model[name][order] for name in bodies})
        assert block["outcome"] is None
        assert renamed.advance(5, 5, False, 1e9)["outcome"] is None
        off = np.abs(core.frame()["velocity"][order] - renamed.frame()["velocity"]).max()
        if off > 1e-10:
            redundant += 1
            assert law == "poisson", seed
        several += len(np.unique(block["impacts"]["body"], axis=0)) > 1
        if LAWS[law].energy:
            assert beyond_cones(model, block["impacts"]) <= 1e-12, seed
            kinetic, potential = (block["steps"][f"energy_{name}"] for name in ("kinetic", "potential"))
            total = np.append(energy_of(model), kinetic + potential)
            assert np.diff(total).max() <= 1e-10 * (kinetic + np.abs(potential)).max(), seed
    assert several > 200
    assert redundant <= 3


def energy_of(model: dict[str, Any]) -> float:
    """At the start, J."""
    v, w, x = (model[name] for name in ("velocity", "angular_velocity", "position"))
    kinetic = 0.5 * model["mass"] @ (v**2).sum(axis=1) + 0.5 * model["inertia"] @ (w**2).sum(axis=1)
    return float(kinetic - model["mass"] @ x @ model["gravity"])


def beyond_cones(model: dict[str, Any], impacts: dict[str, np.ndarray]) -> float:
    """How far impulses of impacts are outside of their cones, over the largest one; with rolling and spinning friction."""
    rows = impacts["problem"] > 0
    if not rows.any():
        return 0.0
    normal, impulse, moment = (impacts[name][rows] for name in ("normal", "impulse", "moment"))
    of_floor = (impacts["body"][rows][:, 1] >= len(model["radius"])).astype(int)
    along, spin = np.einsum("nij,ij->ni", np.array([impulse, moment]), normal)
    across = np.linalg.norm(impulse - along[:, None] * normal, axis=1)
    roll = np.linalg.norm(moment - spin[:, None] * normal, axis=1)
    friction, rolling, spinning = (
        model[name][of_floor] * along for name in ("friction", "rolling_radius", "spinning_radius")
    )
    beyond = [-along, across - friction, (roll - rolling) / 0.03, (np.abs(spin) - spinning) / 0.03]
    return float(np.max(beyond) / np.abs(impulse).max())


@LAW
@pytest.mark.parametrize("rolling", [0.0, 1e-4])
def test_piles_have_the_law_of_rows(law: str, rolling: float) -> None:
    """A crooked chain of 30 balls. Frames of both differ by the turn in a step, which is short."""
    rng = np.random.default_rng(1)
    ways = np.column_stack([np.ones(29), 0.4 * rng.normal(size=(29, 2))])
    ways *= 0.02 / np.linalg.norm(ways, axis=1, keepdims=True)
    scene = carom.Scene(gravity=(0, 0, 0))
    scene.material("m")
    scene.contact("m", "m", friction=0.3, restitution=0.8, tangential_restitution=0.3, rolling_radius=rolling)
    for k, x in enumerate(np.vstack([np.zeros(3), np.cumsum(ways, axis=0)])):
        scene.sphere(f"{k}", radius=0.01, material="m", density=7800.0, position=x.tolist(),
                     velocity=(1.0, 0.3, -0.2) if k == 0 else None)  # fmt: skip
    ends = [
        simulated(
            scene, impact=law, step=1e-7, until=1e-7, pile_tolerance=1e-9, pile_contacts=largest
        ).velocity[-1]
        for largest in (5, 100)
    ]
    np.testing.assert_allclose(*ends, atol=1e-5)


@pytest.mark.parametrize("e", [0.0, 0.6, 1.0])
def test_a_column_on_a_floor_rebounds_by_poissons_law(e: float) -> None:
    """The floor gives e times the impulse that stops the ball on top: a squeezed column has its restitution."""
    scene = carom.Scene(gravity=(0, 0, -9.81))
    scene.material("m")
    scene.contact("m", "m", friction=0.2, restitution=e)
    scene.plane("floor", material="m", point=(0, 0, 0), normal=(0, 0, 1))
    for k in range(5):
        scene.sphere(f"{k}", radius=0.01, material="m", density=7800.0, position=(0, 0, 0.01 + 0.02 * k),
                     velocity=(0, 0, -1.0) if k == 4 else None)  # fmt: skip
    after = simulated(scene, impact="poisson", step=1e-5, until=1e-5).velocity[-1]
    assert after[:, 2].sum() == pytest.approx(e * 1.0 - (4 * 9.81e-5 if e > 0.0 else 0.0), abs=5e-4)


def dragged_pair(law: str, seed: int) -> carom.Result:
    """An elastic ball with drag hits another one, obliquely."""
    rng = np.random.default_rng(seed)
    normal, across = rng.normal(size=(2, 3))
    normal /= np.linalg.norm(normal)
    across -= (across @ normal) * normal
    scene = carom.Scene(gravity=(0, 0, 0))
    scene.contact("ball", "ball", friction=0.0, restitution=1.0)
    scene.sphere("hit", radius=0.02, mass=0.1, material="ball", position=(0, 0, 0))
    fast = 2.0 * across / np.linalg.norm(across) - normal
    scene.sphere("thrown", radius=0.02, mass=0.08, material="ball", position=0.0401 * normal, velocity=fast)
    scene.drag("thrown", translation=0.4)
    return carom.simulate(scene, until=0.002, step=1e-3, impact=law)


@pytest.mark.filterwarnings("ignore::carom.CaromWarning")
@pytest.mark.parametrize("seed", range(8))
def test_of_a_pair_poissons_law_is_newtons_with_drag_too(seed: int) -> None:
    """Drag slows the ball within the step, and restitution of the speed before it would add energy: both take as much of it
    back (rule R4), although the normal turns and Poisson's law needs two problems.
    """
    one, other = (dragged_pair(law, seed) for law in ("sequence", "poisson"))
    assert one.summary["restitution_scale_min"] < 1.0
    np.testing.assert_allclose(other.velocity[-1], one.velocity[-1], rtol=0.0, atol=1e-9)


@LAW
def test_what_a_law_does_not_read_is_said(law: str) -> None:
    told = [p for p in balls(0.0, 1.0, law, e_t=0.3).validate() if "does not read" in p.cause]
    assert bool(told) == ("tangential_restitution" not in LAWS[law].needs)


# ---------------------------------------------------------------------------------------------- side by side


def test_the_page_of_the_laws_is_what_its_command_prints() -> None:
    spec = importlib.util.spec_from_file_location("impact_laws_page", ROOT / "validation" / "impact_laws.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    number = re.compile(r"(?<![\w.-])[-+]?[0-9]+(?:[.][0-9]+)?(?![\w.])")
    fresh, page = "".join(module.parts()), module.PAGE.read_text("utf-8")
    assert "-0.0000" not in fresh
    assert number.sub("#", fresh) == number.sub("#", page)
    found, stated = (np.array([float(x) for x in number.findall(text)]) for text in (fresh, page))
    np.testing.assert_allclose(found, stated, atol=1.5e-4, rtol=2e-3)


def test_laws_are_compared_side_by_side(tmp_path: Path) -> None:
    found = carom.compare(chain(3), laws="all")
    assert [run.name for run in found] == [f"nsga+{law}" for law in LAWS]
    assert found["nsga+poisson"].states["velocity"][-1][:, 0] == pytest.approx([-1 / 3, 2 / 3, 2 / 3])
    assert "half of it after so many impact problems" in str(found)
    for run in found:
        # What every pair got is the momentum of the balls behind it.
        mass = 4 / 3 * np.pi * 0.01**3 * 7800.0
        passed = mass * np.cumsum(run.states["velocity"][-1][::-1, 0])[::-1][1:]
        assert [points[-1, 1] for points in run.impulses.values()] == pytest.approx(passed, rel=1e-9)
        assert run.order == ("1-2", "2-3")
    halves = [row["half_at"] for row in found.to_dict()["methods"][-1]["impulses"].values()]
    assert 0.0 < halves[0] < halves[1] < 1.0
    with pytest.raises(carom.CaromError, match="not both"):
        carom.compare(chain(3), "nsga", laws="all")
    figure = tmp_path / "laws.svg"
    scenario = ROOT / "scenarios" / "three_balls.toml"
    arguments = ["compare", str(scenario), "--laws", "sequence,binary", "--plot", str(figure), "-q"]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0, done.output
    assert "nsga+binary" in done.stdout
    assert figure.stat().st_size > 0
    speeds = figure.with_suffix(".csv").read_text().splitlines()
    assert speeds[0] == "body,nsga+sequence v_x (m/s),nsga+binary v_x (m/s)"
    assert [line.partition(",")[0] for line in speeds[1:]] == carom.example("three_balls").names
    assert "first-second (N s)" in (tmp_path / "laws_impulses.csv").read_text().splitlines()[0]
    figure.with_suffix(".csv").unlink()
    again = CliRunner().invoke(app, [*arguments[:-2], str(tmp_path / "laws.png")])
    assert "laws_impulses.csv exists already" in again.stderr


def test_chains_have_the_sizes_and_gaps_that_are_asked_for() -> None:
    scene = chain(4, taper=0.5, gap=1e-3)
    x = [s.position[0] for s in scene.spheres]
    radii = [s.radius for s in scene.spheres]
    assert radii == pytest.approx([0.01, 0.005, 0.0025, 0.00125])
    assert np.diff(x) - np.array(radii[1:]) - radii[:-1] == pytest.approx([1e-3] * 3)
    assert [s.radius for s in chain(4, between=0.002).spheres] == [0.01, 0.002, 0.01, 0.002]
    result = simulated(chain(3, gap=1e-3))
    assert result.velocity[-1][:, 0] == pytest.approx([0, 0, 1], abs=1e-9)
    assert simulated(column(3)).names == ["1", "2", "3"]


@pytest.mark.parametrize(
    ("made", "told"),
    [
        (lambda: chain(2.5), "chain: count must be a whole number of at least 2 balls, found 2.5"),  # type: ignore[arg-type]
        (lambda: chain(3, speed=0), "chain: speed must be positive, found 0"),
        (lambda: chain(3, gap=-1e-3), "chain: gap must be zero or positive, found -0.001"),
        (lambda: chain(3, taper=0.5, between=0.01), "give taper or between, not both"),
        (lambda: column(3, gravity=float("nan")), "column: gravity must be a finite number"),
        (lambda: cradle(3, lifted=3), "cradle: lifted must be less than count, 3 balls, found 3"),
        (lambda: cradle(3, angle=400), "cradle: angle must be at most 90 degrees, found 400"),
        (lambda: cradle(3, angle="400 deg"), "cradle: angle must be at most 90 degrees, found '400 deg'"),
        (lambda: cradle(3, angle="4 m"), "cradle: angle: expected an angle"),
        (lambda: cradle(3, length=0), "cradle: length must be positive, found 0"),
    ],
)
def test_what_is_no_row_of_balls_is_refused(made: Callable[[], carom.Scene], told: str) -> None:
    with pytest.raises(carom.CaromError, match=re.escape(told)):
        made()


@LAW
def test_a_cradle_hangs_on_its_rods_by_every_law(law: str) -> None:
    """What the first hit gives is that of the row; rods keep their lengths, and nothing is gained."""
    scene = cradle(3, angle="10 deg", length="20 cm", restitution=1.0, hits=0.7)
    result = simulated(scene, impact=law)
    drop = np.sqrt(2 * 9.81 * 0.2 * (1 - np.cos(np.radians(10.0))))
    row = simulated(chain(3, speed=1.0), impact=law).velocity[-1][:, 0]
    hit = int(np.argmax(np.abs(result.velocity[:, 2, 0]) > 0.1 * drop))
    assert result.velocity[hit][:, 0] / drop == pytest.approx(row, abs=2e-3)
    hooks = np.array([[0.02 * k, 0.0, 0.0] for k in range(3)])
    assert np.linalg.norm(result.position - hooks, axis=2) == pytest.approx(0.2, abs=1e-10)
    if LAWS[law].energy:
        kinetic = float(result.energy.kinetic.max())
        assert float(result.energy.total.max() - result.energy.total[0]) <= 1e-6 * kinetic


# ---------------------------------------------------------------------------------------------- the expansion, judged


def heap(e_t: float = 0.0) -> carom.Scene:
    """A ball falls on two that lie side by side on a floor: the impulses of compression are unique."""
    scene = carom.Scene(gravity=(0, 0, -9.81))
    scene.contact("m", "m", friction=0.1, restitution=0.5, tangential_restitution=e_t)
    scene.contact("m", "floor", friction=0.3, restitution=0.8, tangential_restitution=e_t)
    scene.plane("floor", material="floor", point=(0, 0, 0), normal=(0, 0, 1))
    for name, x in (("a", 0.0), ("b", 0.02)):
        scene.sphere(name, radius=0.01, material="m", density=7800.0, position=(x, 0, 0.01))
    height = 0.01 + 0.01 * np.sqrt(3.0)
    scene.sphere("c", radius=0.01, material="m", density=7800.0, position=(0.01, 0, height),
                 velocity=(0.05, 0.1, -1.0))  # fmt: skip
    return scene


def law_of_the_floor(key: str, value: float) -> Callable[[Path], None]:
    def plant(run: Path) -> None:
        path = run / "scenario.toml"
        head, floor = path.read_text("utf-8").split('between = ["m", "floor"]')
        path.write_text(
            f'{head}between = ["m", "floor"]{re.sub(f"(?m)^{key} = .*", f"{key} = {value}", floor, count=1)}'
        )

    return plant


@pytest.mark.parametrize("e_t", [0.0, 0.3])
@pytest.mark.parametrize(
    ("plant", "kind"),
    [
        (law_of_the_floor("restitution", 0.81), "impact"),
        (law_of_the_floor("restitution", 0.79), "impact"),
        (law_of_the_floor("tangential_restitution", 0.32), "slip"),
    ],
)
def test_the_auditor_finds_the_impulses_of_compression(
    e_t: float, plant: Callable[[Path], None], kind: str, tmp_path: Path
) -> None:
    simulated(
        heap(e_t), impact="poisson", step=1e-4, until=1e-3, impacts="every", out=tmp_path / "run"
    ).close()
    assert check(tmp_path / "run").ok
    plant(tmp_path / "run")
    assert check(tmp_path / "run")[kind].word == "violated"


def test_the_auditor_misses_an_expansion_that_was_left_out(tmp_path: Path) -> None:
    """The run of a plastic impact, whose file says e_N = 0.8."""
    scene = heap()
    for law in scene.contacts:
        law.restitution = 0.0
    simulated(scene, impact="poisson", step=1e-4, until=1e-4, impacts="every", out=tmp_path / "run").close()
    assert check(tmp_path / "run").ok
    law_of_the_floor("restitution", 0.8)(tmp_path / "run")
    assert check(tmp_path / "run")["impact"].word == "violated"


def rolling_heap() -> carom.Scene:
    scene = heap()
    for law in scene.contacts:
        law.rolling_radius = 1e-4
    return scene


@pytest.mark.parametrize(
    ("scene", "until", "told"),
    [
        (heap, 1e-4, ""),
        (rolling_heap, 1e-4, "groups with rolling or spinning bounds"),
        (lambda: chain(62, speed=1.0), 1e-4, "groups of more than 60 contacts"),
        (lambda: cradle(3, angle=1.0, length=0.2, restitution=1.0), 0.3, "groups with joints or dampers"),
    ],
)
def test_the_auditor_tells_which_expansions_it_does_not_judge(
    scene: Callable[[], carom.Scene], until: float, told: str, tmp_path: Path
) -> None:
    simulated(
        scene(), impact="poisson", step=1e-4, until=until, impacts="every", out=tmp_path / "run"
    ).close()
    report = check(tmp_path / "run")
    for kind in ("impact", "slip"):
        reasons = [left.why for left in report[kind].unjudged if "expands" in left.why]
        assert len(reasons) == bool(told)
        assert all(told in reason for reason in reasons)


@pytest.mark.parametrize("law", [{"expression": "0.8/(1+v)"}, {"table": [[0, 0.9], [5, 0.5]]}])
def test_a_restitution_law_beside_a_spinning_radius_is_audited(law: dict[str, Any]) -> None:
    """The compression of such a contact is not known to the auditor: its bound was no number."""
    scene = carom.Scene(gravity=(0, 0, -9.8))
    scene.contact("b", "b", friction=0, restitution=law, spinning_radius=1e-3)
    scene.plane("f", point=(0, 0, 0), normal=(0.2, 0.1, 1), material="b")
    scene.sphere("a", radius=0.02, mass=0.05, at=(0, 0, 0.1), velocity=(0.9, 0.1, -0.5), material="b")
    report = carom.audit.check(carom.simulate(scene, step=1e-3, until=0.2, impact="poisson"))
    assert report.ok, str(report)


@pytest.mark.parametrize("method", ["events", "moreau", "nsga"])
def test_a_perfect_superball_turns_its_slip_round(method: str) -> None:
    """R. L. Garwin, Am. J. Phys. 37, 88, 1969: e_N = e_T = 1, the energy stays."""
    scene = carom.Scene(gravity=(0, 0, 0))
    scene.contact("b", "b", friction=10, restitution=1, tangential_restitution=1)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="b")
    scene.sphere("b", radius=0.02, mass=0.1, material="b", position=(0, 0, 0.1), velocity=(1.3, 0.4, -2.0),
                 angular_velocity=(10, -30, 5))  # fmt: skip
    run = carom.simulate(scene, until=0.1, step=1e-3, method=method)
    slip = run.velocity[:, 0] + np.cross(run.angular_velocity[:, 0], [0, 0, -0.02])
    assert slip[0] == pytest.approx([1.9, 0.6, -2.0])
    assert slip[-1] == pytest.approx([-1.9, -0.6, 2.0])
    assert run.summary["energy"]["final"] == pytest.approx(run.summary["energy"]["initial"], rel=1e-12)
