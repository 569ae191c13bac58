"""Free walls: planes with a mass that what presses them moves along their normals."""

from __future__ import annotations

from pathlib import Path

import carom
import numpy as np
import pytest
from carom.errors import CaromError, ScenarioError
from carom.result.remarks import remarks
from carom.result.walls import FreePoses

G = 9.81
RADIUS, MASS = 0.01, 0.02


def one_ball(
    *, e: float = 0.0, mu: float = 0.0, gravity: float = G, floor: bool = True, **free
) -> carom.Scene:
    """A ball on a floor, and a lid above it."""
    scene = carom.Scene()
    scene.world.gravity = (0.0, 0.0, -gravity)
    scene.material("steel")
    scene.contact("steel", "steel", friction=mu, restitution=e)
    if floor:
        scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="steel")
    scene.plane("lid", point=(0, 0, 0.03), normal=(0, 0, -1), material="steel", free=free)
    return scene


def pressed(count: int = 60, *, mu: float = 0.3, e: float = 0.2, room: float = 1.3, **free) -> carom.Scene:
    """Grains in a box without a top, below a lid; without gravity."""
    scene = carom.Scene()
    scene.world.gravity = (0.0, 0.0, 0.0)
    scene.material("glass")
    scene.contact("glass", "glass", friction=mu, restitution=e)
    side = 5.0 * 2.0 * RADIUS * 0.8
    high = side * count / 60 * room
    scene.box("box", low=(0, 0, 0), high=(side, side, high), open=["high_z"], material="glass")
    free = {"mass": 0.1, "force": 20.0} | free
    scene.plane("lid", point=(0, 0, high), normal=(0, 0, -1), material="glass", free=free)
    scene.packing("grain", material="glass", density=2500, seed=3, count=count, diameter=2 * RADIUS,
                  low=(0, 0, 0), high=(side, side, high))  # fmt: skip
    return scene


def test_a_lid_presses_with_its_force_and_its_weight() -> None:
    for weight in (True, False):
        scene = one_ball(mass=0.2, force=5.0, weight=weight)
        scene.sphere("ball", radius=RADIUS, mass=MASS, position=(0, 0, RADIUS), material="steel")
        result = carom.simulate(scene, step=1e-3, until=0.2, every=1)
        lid = result.walls["lid"]
        force = 5.0 + (0.2 * G if weight else 0.0)
        assert lid.force[-20:, 2] == pytest.approx(force, rel=1e-9)
        assert result.walls["floor"].force[-20:, 2] == pytest.approx(-force - MASS * G, rel=1e-9)
        assert lid.position[-1] == pytest.approx([0, 0, 2 * RADIUS], abs=1e-12)
        assert lid.is_free
        assert not result.walls["floor"].is_free
        assert abs(lid.velocity[-20:]).max() < 1e-12


@pytest.mark.parametrize("method", ["nsga", "moreau"])
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_a_ball_and_a_wall_collide_as_two_bodies(method: str, e: float) -> None:
    mass, speed = 0.05, 2.0
    scene = one_ball(e=e, gravity=0.0, floor=False, mass=mass, velocity=0.5)
    scene.sphere("ball", radius=RADIUS, mass=MASS, position=(0, 0, 0), velocity=(0.3, 0, speed),
                 angular_velocity=(1.0, 2.0, 3.0), material="steel")  # fmt: skip
    result = carom.simulate(scene, step=1e-4, until=0.05, every=1, method=method)
    # The lid moves down at 0.5 m/s.
    common = (MASS * speed - mass * 0.5) / (MASS + mass)
    ball, lid = result.velocity[-1, 0], -result.walls["lid"].velocity[-1]
    assert ball[2] == pytest.approx(common - e * mass / (MASS + mass) * (speed + 0.5), rel=1e-12)
    assert lid == pytest.approx(common + e * MASS / (MASS + mass) * (speed + 0.5), rel=1e-12)
    assert ball[0] == pytest.approx(0.3, rel=1e-12)
    energy = np.asarray(result.steps["energy_kinetic"])
    lost = 0.5 * MASS * mass / (MASS + mass) * (1 - e * e) * (speed + 0.5) ** 2
    assert energy[0] - energy[-1] == pytest.approx(lost, abs=1e-12)


def test_friction_does_not_move_a_wall_sideways() -> None:
    """A ball that slides on a wall loses momentum to the guide, and the wall gets what is normal."""
    scene = one_ball(mu=0.4, gravity=0.0, floor=False, mass=0.05)
    scene.sphere(
        "ball", radius=RADIUS, mass=MASS, position=(0, 0, 0), velocity=(3.0, 0, 2.0), material="steel"
    )
    result = carom.simulate(scene, step=1e-4, until=0.05, every=1)
    ball, lid = result.velocity[-1, 0], result.walls["lid"]
    normal = MASS * (2.0 - ball[2])
    assert normal == pytest.approx(-0.05 * lid.velocity[-1], rel=1e-12)
    assert MASS * (3.0 - ball[0]) == pytest.approx(0.4 * normal, rel=1e-9)
    assert lid.position[:, :2] == pytest.approx(0.0, abs=0.0)


def test_a_wall_alone_follows_its_force() -> None:
    scene = one_ball(gravity=0.0, floor=False, mass=2.0, force={"expression": "4*t"}, velocity=0.1)
    scene.sphere("ball", radius=RADIUS, mass=MASS, position=(0, 0, -5.0), material="steel")
    result = carom.simulate(scene, step=1e-3, until=0.5, every=100)
    t, lid = np.asarray(result.time), result.walls["lid"]
    assert lid.velocity == pytest.approx(0.1 + t * t, abs=2e-3)
    assert 0.03 - lid.position[:, 2] == pytest.approx(0.1 * t + t**3 / 3, abs=1e-3)
    steps = result.steps
    energy = np.asarray(steps["energy_kinetic"])
    assert energy - np.cumsum(steps["energy_work"]) == pytest.approx(0.5 * 2.0 * 0.01, abs=1e-6)


def test_a_lid_holds_its_pressure_on_grains() -> None:
    result = carom.simulate(pressed(), step=2e-4, until=0.2, every=50, impact="one-shot")
    lid, floor = result.walls["lid"], result.walls["box.low_z"]
    late = slice(-10, None)
    assert lid.force[late, 2] == pytest.approx(20.0, rel=0.01)
    assert 8.0 < -floor.force[-1, 2] < 20.0  # friction of the sides takes a part
    assert result.summary["energy"]["max_rise_relative"] < 1e-12
    assert result.summary["unconverged"] == 0


def test_sweeps_and_newtons_method_agree() -> None:
    """Both forms of a contact problem have the guide, with friction, rolling and several contacts of the wall."""
    found = []
    for pile_contacts in (10, 10_000):
        scene = pressed(30, mu=0.5, e=0.0, room=1.8)
        options = {"tolerance": 1e-12, "pile_tolerance": 1e-12, "pile_contacts": pile_contacts}
        result = carom.simulate(scene, step=2e-4, until=0.04, every=10, impact="one-shot", **options)
        found.append((result.walls["lid"].position[:, 2], np.asarray(result.position)))
        assert max(result.steps["contacts"]) > 20
    (lid, balls), (again, same) = found
    assert np.ptp(lid) > 1e-3
    # They part as all that collides does, by a factor of ten in the last third.
    assert lid[:4] == pytest.approx(again[:4], abs=1e-8)
    assert lid[:14] == pytest.approx(again[:14], abs=1e-7)
    assert balls[:4] == pytest.approx(same[:4], abs=1e-7)


@pytest.mark.parametrize("layers", [2, 6])
def test_heavy_walls_are_like_walls_that_stand(layers: int) -> None:
    """Grains of a milligram between walls of kilograms: what differs is the share of the masses, and no law is broken.

    Residuals were once measured by the mean mass, which is that of the walls. Six layers are swept as a pile.
    """
    across = 2 if layers == 2 else 4

    def run(mass: float | None) -> carom.Result:
        scene = carom.Scene(gravity=(0, 0, -9.8))
        scene.contact("g", "g", friction=0.4, restitution=0.3)
        rng, r = np.random.default_rng(1), 5e-4
        for i in range(layers * across**2):
            place = (i % across, i // across % across, i // across**2)
            at = np.multiply(place, (2.4 * r, 2.4 * r, 2.6 * r)) + 1.2 * r
            velocity = rng.uniform(-0.05, 0.05, 3)
            scene.sphere(f"b{i}", material="g", radius=r, density=2500, at=at, velocity=velocity)
        free = {} if mass is None else {"free": {"mass": mass, "weight": False}}
        wide = 2.4 * r * across + 0.2 * r
        for name, place, normal in (
            ("floor", (0, 0, 0), (0, 0, 1)),
            ("left", (0, 0, 0), (1, 0, 0)),
            ("right", (wide, 0, 0), (-1, 0, 0)),
            ("front", (0, 0, 0), (0, 1, 0)),
            ("back", (0, wide, 0), (0, -1, 0)),
        ):
            scene.plane(name, material="g", point=place, normal=normal, **free)
        return carom.simulate(scene, step=5e-4 if layers == 2 else 2e-4, until=0.1, every=1)

    stands, early = run(None), slice(0, 40)  # after some impacts they part as all that collides does
    assert max(stands.steps["contacts"]) > (100 if layers == 6 else 10)
    for mass in (0.1, 10.0, 1000.0):
        found = run(mass)
        off = np.abs(np.asarray(found.velocity)[early] - np.asarray(stands.velocity)[early]).max()
        assert off < max(1e-4 / mass, 1e-6)
        report = carom.audit.check(found)
        assert report.ok, str(report)


def test_resumed_and_on_threads_it_is_the_same_to_the_last_bit(tmp_path: Path) -> None:
    scene = pressed(30)
    options = {"step": 2e-4, "every": 10, "impact": "one-shot"}
    whole = carom.simulate(scene, until=0.1, out=tmp_path / "whole", **options)
    threads = carom.simulate(scene, until=0.1, threads=2, **options)
    stop = carom.simulate(scene, until=0.1, out=tmp_path / "cut", stop=lambda s: s.time > 0.05, **options)
    assert stop.status != "done"
    resumed = carom.resume(tmp_path / "cut")
    for other in (threads, resumed):
        assert np.array_equal(whole.walls["lid"].position, other.walls["lid"].position)
        assert np.array_equal(np.asarray(whole.position), np.asarray(other.position))


def test_a_turned_scene_moves_as_the_turned_motion() -> None:
    """The lid above, or on a side: the same motion along other axes."""
    along = []
    for axis in (2, 0):
        up = np.eye(3)[axis]
        scene = carom.Scene()
        scene.world.gravity = tuple(-G * up)
        scene.material("steel")
        scene.contact("steel", "steel", friction=0.3, restitution=0.4)
        scene.plane(
            "lid",
            point=tuple(0.05 * up),
            normal=tuple(-up),
            material="steel",
            free={"mass": 0.1, "force": 2.0},
        )
        scene.plane("floor", point=(0, 0, 0), normal=tuple(up), material="steel")
        scene.sphere("ball", radius=RADIUS, mass=MASS, position=tuple(0.011 * up), material="steel")
        result = carom.simulate(scene, step=1e-4, until=0.2, every=100)
        along.append(result.walls["lid"].position @ up)
    assert along[0] == pytest.approx(along[1], abs=1e-12)


def layer(share: float) -> carom.Scene:
    """400 balls just above a floor, and a lid of a share of their mass that hits all of them."""
    scene = carom.Scene()
    scene.world.gravity = (0.0, 0.0, -G)
    scene.material("steel")
    scene.contact("steel", "steel", friction=0.3, restitution=0.3)
    scene.plane("floor", point=(0, 0, -5e-4), normal=(0, 0, 1), material="steel")
    free = {"mass": share * 400 * MASS, "velocity": 1.0}
    scene.plane("lid", point=(0, 0, 2 * RADIUS), normal=(0, 0, -1), material="steel", free=free)
    for k in range(400):
        place = (0.0201 * (k // 20), 0.0201 * (k % 20), RADIUS)
        scene.sphere(f"ball{k}", radius=RADIUS, mass=MASS, position=place, material="steel")
    return scene


@pytest.mark.parametrize("method", ["nsga", "moreau"])
@pytest.mark.parametrize("share", [0.003, 0.03, 0.3])
def test_sweeps_converge_below_light_lids(share: float, method: str) -> None:
    result = carom.simulate(layer(share), step=1e-3, until=3e-3, every=1, impact="one-shot", pile_tolerance=1e-4,
                            method=method)  # fmt: skip
    assert max(result.steps["sweeps_velocity"]) < 1000
    assert result.summary["unconverged"] == result.summary["fallbacks"] == result.summary["halvings"] == 0


def test_a_lid_at_rest_without_gravity_gains_no_energy() -> None:
    scene = one_ball(gravity=0.0, mass=0.1, force=5.0)
    scene.sphere("ball", radius=RADIUS, mass=MASS, position=(0, 0, RADIUS), material="steel")
    result = carom.simulate(scene, step=1e-3, until=0.2, every=1)
    assert result.summary["energy"]["rises"] == 0
    assert result.summary["energy"]["max_rise_relative"] < 1e-12


def test_stepping_shows_and_restores_free_walls() -> None:
    scene = one_ball(mass=0.2, force=5.0)
    scene.sphere("ball", radius=RADIUS, mass=MASS, position=(0, 0, RADIUS), material="steel")
    simulation = carom.Simulation(scene, step=1e-3)
    simulation.step(20)
    ((way, speed),) = simulation.free_walls
    assert way == pytest.approx(0.5 * (5.0 / 0.2 + G) * 0.02**2, rel=1e-9)
    assert speed == pytest.approx((5.0 / 0.2 + G) * 0.02, rel=1e-9)
    state = simulation.state()
    simulation.step(10)
    after = simulation.free_walls
    simulation.restore(state)
    simulation.step(10)
    assert np.array_equal(simulation.free_walls, after)
    for name, value in (
        ("velocity", (1.0, 0, 0)),
        ("position", (1e-3, 0, 0)),
        ("angular_velocity", (0, 0, 1.0)),
    ):
        wrong = {key: np.array(array) for key, array in state.items()}
        wrong[name][1] = value
        with pytest.raises(CaromError, match="free wall"):
            simulation.restore(wrong)


def test_a_light_wall_that_goes_far_in_a_step_is_told() -> None:
    scene = one_ball(mass=1e-5, force=5.0)
    scene.sphere("ball", radius=RADIUS, mass=MASS, position=(0, 0, RADIUS), material="steel")
    scene = scene.with_options(step=1e-3, until=0.1)
    (advice,) = [str(a) for a in scene.validate() if "lid" in str(a)]
    assert "25 radii of the smallest ball" in advice
    assert "step = 0.0001 is safe" in advice


@pytest.mark.parametrize(
    ("free", "text"),
    [
        ({}, "mass"),
        ({"mass": 0.0}, "mass"),
        ({"mass": 1.0, "force": 1.0, "pressure": 2.0, "area": 1.0}, "both force and pressure"),
        ({"mass": 1.0, "area": 2.0}, "area is given without pressure"),
        ({"mass": 1.0, "forze": 2.0}, "unknown key"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named(free: dict[str, float], text: str) -> None:
    with pytest.raises(ScenarioError, match=text):
        one_ball(**free)


def test_what_cannot_be_free_is_refused() -> None:
    scene = one_ball(mass=1.0)
    with pytest.raises(ScenarioError, match="size is given"):
        scene.plane(
            "piece", point=(0, 0, 1), normal=(0, 0, 1), material="steel", size=(1, 1), free={"mass": 1.0}
        )
    with pytest.raises(ScenarioError, match="both motion and free"):
        scene.plane("both", point=(0, 0, 1), normal=(0, 0, 1), material="steel", free={"mass": 1.0},
                    motion={"until": 1.0})  # fmt: skip
    scene.sphere("ball", radius=RADIUS, mass=MASS, position=(0, 0, RADIUS), material="steel")
    for method in ("penalty", "events"):
        with pytest.raises(CaromError, match="free walls"):
            carom.simulate(scene, step=1e-3, until=0.01, method=method)


def cell(
    *,
    pressure: object = 1000.0,
    side: float = 0.1,
    velocity: float = 0.0,
    mass: float = 0.02,
    **motion: object,
) -> carom.Scene:
    """Six planes about the origin that press; with `motion` those along z alone, and one along x moves as prescribed."""
    scene = carom.Scene()
    scene.world.gravity = (0.0, 0.0, 0.0)
    scene.contact("glass", "glass", friction=0.3, restitution=0.2)
    for axis, name in enumerate("xyz"):
        for sign in (1, -1):
            point, normal = np.zeros(3), np.zeros(3)
            point[axis], normal[axis] = -0.5 * sign * side, sign
            given: dict = {"free": {"mass": mass, "pressure": pressure, "velocity": velocity}}
            if motion and axis < 2:
                given = {"motion": motion} if (axis, sign) == (0, -1) else {}
            scene.plane(f"{name}{sign:+d}", point=point, normal=normal, material="glass", **given)
    return scene


@pytest.mark.parametrize("method", ["nsga", "moreau"])
def test_a_pressure_follows_the_area_between_the_walls_around(method: str) -> None:
    # One ball between two plates that press; a wall beside them moves out.
    scene = cell(
        translation=[{"expression": "0.2*t"}, 0, 0], pressure={"expression": "1000+500*t"}, velocity=0.1
    )
    scene.sphere("ball", radius=0.02, mass=0.02, position=(0, 0, 0), material="glass")
    result = carom.simulate(scene, step=1e-4, until=0.4, every=10, method=method)
    time = np.asarray(result.time)[-50:]
    force = (1000 + 500 * time) * 0.1 * (0.1 + 0.2 * time)
    for name, sign in (("z+1", -1), ("z-1", 1)):
        assert sign * result.walls[name].force[-50:, 2] == pytest.approx(force, rel=1e-3)
    energy = result.summary["energy"]
    # Moreau-Jean takes the force of the end of the step for the whole of its way.
    assert energy["max_rise_relative"] < (1e-9 if method == "nsga" else 1e-4)


def test_a_cell_of_six_free_planes_holds_its_pressure_as_it_shrinks() -> None:
    scene = cell(side=0.16)
    scene.packing("grain", material="glass", density=2500, seed=3, count=100, diameter=0.02,
                  low=(-0.08,) * 3, high=(0.08,) * 3)  # fmt: skip
    result = carom.simulate(scene, step=2e-4, until=0.2, every=10, impact="one-shot", pile_tolerance=1e-5)
    place = {name: result.walls[name].position[:, axis] for axis, axis_name in enumerate("xyz")
             for name in (f"{axis_name}+1", f"{axis_name}-1")}  # fmt: skip
    lengths = np.array([place[f"{name}-1"] - place[f"{name}+1"] for name in "xyz"])
    assert (lengths[:, -1] < 0.8 * 0.16).all()
    late = slice(-20, None)
    for axis, name in enumerate("xyz"):
        area = np.prod(lengths[[k for k in range(3) if k != axis]], axis=0)
        for sign in (1, -1):
            pressure = -sign * result.walls[f"{name}{sign:+d}"].force[:, axis] / area
            assert pressure[late].mean() == pytest.approx(1000.0, rel=0.01)
    assert result.summary["unconverged"] == 0


@pytest.mark.filterwarnings("ignore:.*the wall stays:carom.CaromWarning")
def test_an_area_beside_a_wall_that_is_taken_away_is_refused(tmp_path: Path) -> None:
    """It went on growing with a wall that was there no longer."""

    def scene(**given: float) -> carom.Scene:
        made = one_ball(mass=0.2, pressure=100.0, **given)
        made.sphere("ball", radius=RADIUS, mass=MASS, position=(0, 0, RADIUS), material="steel")
        made.world.periodic = (0.1, 0, 0)
        made.plane("near", material="steel", point=(0, -0.05, 0), normal=(0, 1, 0))
        made.plane("far", material="steel", point=(0, 0.05, 0), normal=(0, -1, 0), motion={"until": 0.1})
        return made

    with pytest.raises(ScenarioError, match=r'and plane "far" beside it is taken away at 0.1 s; give area'):
        scene().validate()
    result = carom.simulate(scene(area=0.01), step=1e-3, until=0.2, every=1)
    assert result.walls["lid"].force[-1, 2] == pytest.approx(0.2 * G + 1.0, rel=1e-9)
    # A run that ends before needs no area, and is refused as soon as it would go on.
    run = carom.simulate(scene(), step=1e-3, until=0.1, every=1, out=tmp_path / "run")
    assert run.walls["lid"].force[-1, 2] == pytest.approx(0.2 * G + 1.0, rel=1e-9)
    with pytest.raises(carom.CaromError, match=r'until: plane "far" is taken away at 0.1 s, and a pressure'):
        carom.resume(tmp_path / "run", until=0.2)
    with pytest.warns(carom.CaromWarning):
        stepped = carom.Simulation(scene(), step=1e-3)
    stepped.step(100)
    with pytest.raises(carom.CaromError, match=r'step: plane "far" is taken away at 0.1 s, and a pressure'):
        stepped.step()


def test_an_area_that_nothing_encloses_is_refused() -> None:
    scene = one_ball(mass=0.2, pressure=100.0)
    scene.sphere("ball", radius=RADIUS, mass=MASS, position=(0, 0, RADIUS), material="steel")
    with pytest.raises(ScenarioError, match="pressure without area"):
        carom.simulate(scene, step=1e-3, until=0.1)
    # Two periods do, and so does an area.
    for change in ({"periodic": (0.1, 0.1, 0)}, {}):
        scene = one_ball(mass=0.2, pressure=100.0, **({} if change else {"area": 0.01}))
        scene.world.periodic = change.get("periodic")
        scene.sphere("ball", radius=RADIUS, mass=MASS, position=(0, 0, RADIUS), material="steel")
        result = carom.simulate(scene, step=1e-3, until=0.2, every=1)
        assert result.walls["lid"].force[-1, 2] == pytest.approx(0.2 * G + 1.0, rel=1e-9)


def test_between_frames_a_free_wall_follows_the_cubic_through_both() -> None:
    """A motion that is a cubic of the time is met everywhere; before the first and after the last frame the wall rests."""
    cubic = np.polynomial.Polynomial([0.1, -0.4, 0.3, 2.0])
    frames, between = np.array([0.0, 0.2, 0.5, 0.6]), np.linspace(0.0, 0.6, 50)
    normal = np.array([0.0, 0.6, 0.8])
    poses = FreePoses(normal, frames, cubic(frames), cubic.deriv()(frames))
    assert np.abs(poses.displacement(between) - np.outer(cubic(between), normal)).max() < 1e-14
    ends = np.outer(cubic(np.array([0.0, 0.6])), normal)
    assert np.abs(poses.displacement(np.array([-1.0, 2.0])) - ends).max() < 1e-14


@pytest.mark.parametrize("until", [None, 0.05])
def test_a_free_wall_that_passes_another_is_told_of(until: float | None) -> None:
    """Nothing is between them, so it goes as if alone: through the floor after sqrt(2 d/g) = 0.078 s."""
    scene = carom.Scene()
    scene.contact("steel", "steel", friction=0.0, restitution=0.0)
    motion = {} if until is None else {"motion": {"until": until}}
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="steel", **motion)
    scene.plane("lid", point=(0, 0, 0.03), normal=(0, 0, 1), material="steel", free={"mass": 0.2})
    scene.sphere("held", radius=RADIUS, mass=MASS, position=(0, 0, 0.2), material="steel")
    scene.joint("fix", body="held")
    short, long = (carom.simulate(scene, step=1e-3, until=end, every=1) for end in (0.07, 0.1))
    fall = 0.5 * np.linalg.norm(scene.world.gravity) * 0.1**2
    assert long.walls["lid"].position[-1, 2] == pytest.approx(0.03 - fall, rel=1e-9)
    assert not remarks(short, "passed")
    told = remarks(long, "passed")
    assert len(told) == (until is None)
    assert all('"lid" was beyond "floor" at t = 0.079 s' in one for one in told)
