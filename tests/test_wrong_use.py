"""What a person may get wrong in Python with a finished run, and with packings: told in words, never by a traceback."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import chdir
from pathlib import Path
from typing import Any

import carom
import pytest
from carom import CaromError, events, granular, packing
from carom.show.film.look import Look

BOX = granular.Box((0, 0, 0), (1, 1, 1))


@pytest.fixture(scope="module")
def result() -> carom.Result:
    """A ball that slides to a stop at another."""
    scene = carom.Scene("wrong use", run={"until": 0.05, "step": 1e-3})
    scene.contact("m", "m", friction=0.3, restitution=0.0)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="m")
    for name, x, v in (("a", 0.0, 0.3), ("b", 0.1, 0.0)):
        scene.sphere(name, radius=0.01, mass=0.01, material="m", at=(x, 0, 0.01), velocity=(v, 0, 0))
    return carom.simulate(scene)


def pack(law: Any = None, **options: Any) -> object:
    return packing.pack(BOX, law or packing.Equal(0.1), **{"seed": 1, "count": 3, **options})


def snapshot(**given: Any) -> granular.Snapshot:
    return granular.Snapshot(**{"position": [[0, 0, 0], [1, 0, 0]], "radius": [0.1, 0.1], **given})


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        (lambda r: events.rest(r, speed=-1.0), "speed = -1.0 is no bound"),
        (lambda r: events.slip_to_roll(r, speed=float("nan")), "speed = nan is no bound"),
        (lambda r: events.phases(r, "a", "floor", speed=-1.0), "speed = -1.0 is no bound"),
        (
            lambda r: events.rest(r, speed="1 mm/s"),
            "speed = '1 mm/s' is no bound of a speed; give a number from 0 in m/s",
        ),
        (lambda r: events.first_contact(r, "a", "a"), "'a' and 'a' are one body; a contact is of two"),
        (lambda r: granular.snapshot(r, 1.0), "no frame 1.0"),
        (lambda r: granular.snapshot(r, time=9.0), "9 s is outside of the run, 0 to 0.05 s"),
        (lambda r: granular.packing_fraction(BOX, r), "takes a Result or a Snapshot first, found Box"),
        (
            lambda r: granular.packing_fraction(r, ((0, 0, 0), (1, 1, 1))),
            "a Box, a Cylinder or a Ball, found tuple",
        ),
        (lambda r: granular.stress(r, None), "a Box, a Cylinder or a Ball, found NoneType"),
        (lambda r: granular.normal_forces(r, bins=0), "0 bins up to 6"),
        (lambda r: granular.run_out(r, sectors=0), "sectors = 0"),
        (lambda r: granular.layers(BOX, "x", 2.5), "three whole numbers from 1"),
        (lambda r: granular.cells(BOX, (0, 1, 1)), "three whole numbers from 1"),
        (lambda r: granular.cells(BOX, (1, 1)), "three whole numbers from 1"),
        (lambda r: granular.cells(BOX, 3), "three whole numbers from 1"),
        (lambda r: granular.layers(BOX, "x", "3"), "at least one layer"),
        (
            lambda r: granular.coordination(r, gap="1 mm"),
            "gap = '1 mm'; surfaces are near each other from 0 m on",
        ),
        (lambda r: granular.coordination(r, least="a"), "least = 'a'; give a whole number of contacts"),
        (lambda r: granular.normal_forces(r, bins=2.5), "2.5 bins up to 6.0"),
        (lambda r: granular.radial_distribution(r, BOX, reach="1 mm"), "reach = '1 mm' and 100 bins"),
        (lambda r: granular.heap_angle(r, cell=0), "cell = 0; give a number above 0"),
        (lambda r: granular.heap_angle(r, between=(0.8, 0.2)), "the lower one first"),
        (lambda r: granular.run_out(r, loose="a"), "loose = 'a'; give a number from 0"),
        (lambda r: granular.run_out(r, sectors=2.5), "sectors = 2.5; give a whole number"),
        (lambda r: snapshot(radius=0.01), "radius is no list; give one radius for each ball"),
        (lambda r: snapshot(radius=[0.1, -0.1]), "radius of ball 1 is -0.1; give a number above 0"),
        (lambda r: snapshot(radius=[float("nan"), 0.1]), "radius of ball 0 is nan"),
        (lambda r: snapshot(radius=["a", 0.1]), "radius is no array of numbers; give it the shape (2,)"),
        (lambda r: snapshot(mass=[0.0, 0.0]), "mass of ball 0 is 0; give a number above 0"),
        (lambda r: snapshot(mass=[1.0, -1.0]), "mass of ball 1 is -1"),
        (lambda r: snapshot(inertia=[1.0, -1.0]), "inertia of ball 1 is -1; give 0 or a number above it"),
        (lambda r: snapshot(period=(-1.0, 0, 0)), "period = [-1.0, 0.0, 0.0]; give lengths in m"),
        (lambda r: granular.over_frames(r, granular.stress, BOX, every=0), "every = 0"),
        (lambda r: r.export("nowhere", "csv", every=1.5), "every: 1.5 is no whole number"),
        (lambda r: r.export("nowhere", "csv", start="0.1"), 'export: start: "0.1" is text without a unit'),
        (lambda r: Look.of("png", {"width": "big"}), "width: 'big' is not a number"),
        (lambda r: Look.of("mp4", {"speed": float("inf")}), "speed: inf is not above 0 and at most"),
        (lambda r: Look.of("png", {"camera": 3}), "camera: there is no 3"),
        (lambda r: carom.audit.check(r)["momentun"], "did you mean momentum"),
        (lambda r: pack(count=0), "count = 0"),
        (lambda r: pack(count=None, fraction=-0.1), "fraction = -0.1"),
        (lambda r: pack(packing.Equal(-0.1)), "a diameter of -0.1 m"),
        (lambda r: pack(packing.Normal(0.0, 0.1, -1.0, 1.0), count=20), "a diameter of -0"),
        (lambda r: pack(gap=-1.0), "gap = -1 m"),
        (lambda r: pack(seed=-1), "seed = -1"),
        (lambda r: pack(seed=1.5), "seed = 1.5"),
        (lambda r: packing.Table((0.1,), (0.0,)), "above 0"),
        (lambda r: packing.Table((0.1,), (0.5, 0.5)), "as many shares as diameters"),
        (
            lambda r: packing.Table((0.1, "b"), (0.5, 0.5)),
            'Table: diameters: "b" is not a number with a unit',
        ),
        (lambda r: packing.Table((0.1, 0.2), (0.5, float("nan"))), "must be numbers above 0"),
        (
            lambda r: packing.Table((0.1,), (1.0,), "number"),
            "by_mass = 'number'; give True for shares of the mass",
        ),
        (lambda r: packing.Table((0.1,), (1.0,), "mass"), "by_mass = 'mass'"),
        (lambda r: packing.Equal("1 ms"), 'Equal: diameter: expected a length, found "1 ms", a time'),
        (lambda r: packing.Uniform(0.1, float("nan")), "Uniform: most = nan"),
        (
            lambda r: packing.Normal(0.1, -0.1, 0.0, 1.0),
            "Normal: deviation = -0.1; give 0 m, of which all are equal",
        ),
        (lambda r: packing.Lognormal(0.0, 0.1, 0.0, 1.0), "Lognormal: mean = 0 m; give a length above 0"),
        (lambda r: pack(count=2.5), "count = 2.5; give a whole number of balls from 1"),
        (lambda r: pack(count=True), "count = True"),
        (lambda r: pack(count=None, fraction="half"), "fraction = 'half'; give a part of the region above 0"),
        (lambda r: pack(gap="-1 mm"), "gap = -0.001 m"),
        (lambda r: pack(gap="1 ms"), 'pack: gap: expected a length, found "1 ms", a time'),
        (
            lambda r: granular.Box((0, 0, 0), (1, 1, "x")),
            'Box: high: "x" is not a number with a unit',
        ),
        (lambda r: granular.Box(0, (1, 1, 1)), "Box: low = 0; give three finite numbers"),
        (lambda r: granular.Box("abc", (1, 1, 1)), "Box: low = 'abc'; give three finite numbers"),
        (
            lambda r: granular.Box((0, 0, 0), (1, 1, 1), periodic="xyz"),
            "Box: periodic = 'xyz'; give True or False for each of x, y and z, for example (True, True, True)",
        ),
        (lambda r: granular.Box((0, 0, 0), (1, 1, 1), periodic="x"), "for example (True, False, False)"),
        (lambda r: granular.Box((0, 0, 0), (1, 1, 1), periodic=(1.0, 1.2, 0)), "periodic = (1.0, 1.2, 0)"),
        (lambda r: granular.Cylinder((0, 0), (0, 0, 1), 1.0, 1.0), "Cylinder: point = (0, 0); give three"),
        (
            lambda r: granular.Cylinder((0, 0, 0), (0, 0, 1), "1", 1.0),
            'Cylinder: radius: "1" is text without a unit',
        ),
        (
            lambda r: granular.Ball((0, 0, float("nan")), 1.0),
            "Ball: point = (0, 0, nan); give three finite numbers",
        ),
    ],
)
def test_what_is_wrong_is_said(
    result: carom.Result, wrong: Callable[[carom.Result], object], told: str
) -> None:
    with pytest.raises(CaromError) as caught:
        wrong(result)
    assert told in str(caught.value)


@pytest.mark.parametrize(("wrong", "found"), [(None, "nothing"), ("", "an empty path"), (3, "int")])
@pytest.mark.parametrize("call", [carom.load, carom.resume])
def test_what_is_no_path_of_a_run_is_said(call: Callable[[Any], object], wrong: Any, found: str) -> None:
    with pytest.raises(
        CaromError, match=f"^{call.__name__} takes the path of a run directory, found {found}; "
    ):
        call(wrong)


def test_a_run_goes_on_from_a_time_with_a_unit(result: carom.Result) -> None:
    taken = [
        [ball.position for ball in carom.Scene().spheres_from(result, time=time)] for time in (0.02, "20 ms")
    ]
    assert taken[0] == taken[1] != [ball.position for ball in carom.Scene().spheres_from(result)]
    with pytest.raises(CaromError, match="spheres_from: time: expected a time"):
        carom.Scene().spheres_from(result, time="2 m")


def test_one_name_is_as_good_as_a_list_of_one(result: carom.Result) -> None:
    """The letters of the name were taken for bodies."""
    pytest.importorskip("matplotlib", reason="the extra [plot] is not installed")
    assert list(result.plot.chart("velocities", bodies="a").data)[1] == "a v_x (m/s)"


def test_a_law_of_no_deviation_gives_equal_balls() -> None:
    for law in (packing.Normal(0.1, 0.0, 0.05, 0.2), packing.Lognormal(0.1, 0, 0.05, float("inf"))):
        drawn = law.draw(20, packing.Stream(1))
        assert drawn == pytest.approx([0.1] * 20, rel=1e-14)


def test_empty_paths_are_none(tmp_path: Path) -> None:
    scene = carom.Scene(run={"until": 0.01})
    scene.contact("m", "m", friction=0, restitution=0)
    scene.sphere("a", radius=0.1, mass=1, at=(0, 0, 0), material="m")
    result = carom.simulate(scene)
    for refused in (
        lambda: carom.simulate(scene, out=""),
        lambda: result.save(""),
        lambda: result.export("", "csv"),
        lambda: carom.audit.check(""),
    ):
        with chdir(tmp_path), pytest.raises(CaromError, match="empty"):
            refused()
    assert not list(tmp_path.iterdir())
    with pytest.raises(CaromError, match=r"audit\.check takes the path of a run directory, found nothing"):
        carom.audit.check(None)  # type: ignore[arg-type]


def test_times_outside_of_a_run_have_no_frame() -> None:
    scene = carom.Scene(run={"until": 0.01})
    scene.contact("m", "m", friction=0, restitution=0)
    scene.sphere("a", radius=0.1, mass=1, at=(0, 0, 0), material="m")
    result = carom.simulate(scene)
    for time in ("1 h", "-1 ms"):
        with pytest.raises(CaromError, match=r"spheres_from: time: .* is outside of the run, 0 to 0\.01 s"):
            carom.Scene().spheres_from(result, time=time)
    with pytest.raises(CaromError, match="step of a slice of times counts frames"):
        result.sel(time=slice("1 ms", "5 ms", "1 ms"))
