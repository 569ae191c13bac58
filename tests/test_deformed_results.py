"""What is made of a run in a box that deforms: the box of a frame, measures, exports, pictures, balls taken over."""

from __future__ import annotations

import dataclasses
import io
import re
from pathlib import Path
from typing import Any

import carom
import h5py
import numpy as np
import pytest
from browser import Browser, find_browser
from carom import granular
from carom.granular import Box, Contacts, Snapshot
from carom.scene.packing.neighbours import pairs, separation
from carom.scene.packing.periodic import PeriodicBox
from carom.show.viewer import write_html
from deformed_runs import CENTRE, LENGTHS, deformed, scene

SHEAR = {"shear": "7*t", "flow": "x", "gradient": "z"}
BOTH = {**SHEAR, "stretch": (1, "exp(-0.5*t)", "1 + 0.2*t")}


@pytest.fixture(scope="module")
def run() -> carom.Result:
    return deformed(scene(**BOTH))


# --------------------------------------------------------------------------------------------- the box of a frame


def test_the_box_of_a_frame_follows_the_laws(run: carom.Result) -> None:
    for k, t in enumerate(np.asarray(run.time)):
        box = run.box(k)
        assert box is not None
        assert box.lengths == pytest.approx(np.array(LENGTHS) * [1, np.exp(-0.5 * t), 1 + 0.2 * t])
        assert box.offset == pytest.approx(7 * t * LENGTHS[2])
        assert box.centre == pytest.approx(CENTRE)
        f = run.scene.world.deformation.gradient_at(t)
        assert box.vectors == pytest.approx((f @ np.diag(LENGTHS)).T)
        against = np.asarray(run.velocity[k]) - box.flow_velocity(np.asarray(run.position[k]))
        assert against == pytest.approx(
            np.asarray(run.velocity[0]) - run.box(0).flow_velocity(run.position[0])
        )
    assert run.periodic == pytest.approx(LENGTHS)


def test_a_result_that_is_saved_has_the_same_boxes(run: carom.Result, tmp_path: Path) -> None:
    saved = run.save(tmp_path / "run")
    with h5py.File(next(saved.path.glob("*.h5"))) as file:
        assert file["frames/box"].shape == (len(run.time), 4)
        assert (file.attrs["box_flow"], file.attrs["box_gradient"]) == (0, 2)
    for k in range(len(run.time)):
        for field in dataclasses.fields(PeriodicBox):
            assert np.array_equal(getattr(saved.box(k), field.name), getattr(run.box(k), field.name))


def test_a_world_that_does_not_deform_has_one_box_and_another_none() -> None:
    made = scene()
    plain = carom.simulate(made, until=0.02)
    assert plain.box(0) == plain.box(-1)
    assert np.array_equal(plain.box().lengths, LENGTHS)
    assert not plain.box().sheared
    assert not plain.box().deforms
    made.periodic = None
    assert carom.simulate(made, until=0.02).box() is None


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda file: file["frames/box"].__setitem__((1, 0), -1.0), "lengths are not above 0"),
        (lambda file: file["frames/box"].__setitem__((1, 1), np.nan), "lengths are not above 0"),
        (lambda file: file.attrs.__setitem__("box_flow", 5), "no two of the axes"),
        (lambda file: file.attrs.__setitem__("box_gradient", 0), "no two of the axes"),
    ],
)
def test_a_damaged_box_is_refused(run: carom.Result, tmp_path: Path, change: Any, told: str) -> None:
    saved = run.save(tmp_path / "run")
    path = next(saved.path.glob("*.h5"))
    saved.close()
    with h5py.File(path, "r+") as file:
        change(file)
    with pytest.raises(carom.CaromError, match=told):
        carom.load(tmp_path / "run").box(1)


# --------------------------------------------------------------------------------------------------- measures


def sheared(offset: float, count: int = 300, seed: int = 5) -> tuple[Snapshot, np.ndarray]:
    """Balls at random in a sheared box, whose overlaps push, and the sum of branch times force."""
    rng = np.random.default_rng(seed)
    box = PeriodicBox(np.array(LENGTHS), CENTRE - 0.5 * np.array(LENGTHS), 0, 2, offset)
    x, r = rng.uniform(-3, 3, (count, 3)), np.full(count, 0.05)
    a, b = pairs(x, r, box)
    delta = separation(x[a] - x[b], box)
    size = np.linalg.norm(delta, axis=1)
    normal, gap = delta / size[:, None], size - 0.1
    force = -1000.0 * gap[:, None] * normal + rng.normal(0, 1, delta.shape)
    touching = Contacts(a, b, normal, force, gap, np.ones(len(a), bool))
    s = Snapshot(x, r, mass=np.ones(count), velocity=np.zeros((count, 3)), contacts=touching, box=box)
    return s, np.einsum("ci,cj->ij", delta, force)


@pytest.mark.parametrize("offset", [0.0, 0.37, 5.9])
def test_stress_of_the_whole_box_is_love_weber_over_all_contacts(offset: float) -> None:
    s, moment = sheared(offset)
    assert len(s.touching.first) > 100
    whole = granular.whole_box(s)
    assert granular.stress(s, whole).tensor == pytest.approx(moment / np.prod(LENGTHS))
    assert granular.packing_fraction(s, whole) == pytest.approx(s.volume.sum() / np.prod(LENGTHS))
    z = granular.coordination(s, region=whole)
    assert z.counted.all()
    assert z.mean == pytest.approx(2.0 * (s.touching.push > 0).sum() / len(s.radius))


@pytest.mark.parametrize("offset", [0.37, 5.9])
def test_measures_do_not_ask_in_which_image_a_ball_is(offset: float) -> None:
    s, _ = sheared(offset)
    turns = np.random.default_rng(2).integers(-3, 4, s.position.shape)
    moved = dataclasses.replace(s, position=s.position + turns @ s.box.vectors)
    low = CENTRE - [0.2, 0.3, 0.5]
    regions = [
        Box(tuple(low), tuple(low + np.array([0.4, 0.5, 0.9]))),
        granular.Ball(tuple(np.add(CENTRE, [0.4, 0.0, 0.5])), 0.3),
        granular.Cylinder(tuple(np.add(CENTRE, [0.0, 0.0, 0.55])), (0, 1, 0), 0.3, 0.5),
    ]
    for region in [granular.whole_box(s), *granular.layers(granular.whole_box(s), "z", 3), *regions]:
        for of in (granular.packing_fraction, lambda s, region: granular.stress(s, region).contact):
            assert of(moved, region) == pytest.approx(of(s, region), rel=1e-9, abs=1e-9)
    near = [granular.coordination(t, gap=0.02).per_ball for t in (s, moved)]
    assert np.array_equal(*near)
    g = [granular.radial_distribution(t, granular.whole_box(t), reach=0.3, bins=20).pairs for t in (s, moved)]
    assert np.array_equal(*g)


def test_layers_across_the_gradient_hold_all_balls_together() -> None:
    s, moment = sheared(0.37)
    layers = granular.layers(granular.whole_box(s), "z", 4)
    volume = [granular.packing_fraction(s, layer) * layer.volume for layer in layers]
    assert sum(volume) == pytest.approx(s.volume.sum())
    stress = sum(granular.stress(s, layer).contact * layer.volume for layer in layers)
    assert stress == pytest.approx(moment)


def test_a_shear_by_whole_lengths_is_none() -> None:
    plain, _ = sheared(0.0)
    again = dataclasses.replace(plain, box=dataclasses.replace(plain.box, offset=-3.0 * LENGTHS[0]))
    region = Box(tuple(CENTRE - 0.3), tuple(CENTRE + 0.5))
    for s in (plain, again):
        assert granular.stress(s, region).tensor == pytest.approx(granular.stress(plain, region).tensor)
    assert np.array_equal(*(granular.coordination(s, gap=0.02).per_ball for s in (plain, again)))


def test_a_box_open_along_the_gradient_alone_is_refused() -> None:
    s, _ = sheared(0.37)
    low, high = s.box.origin, s.box.origin + s.box.lengths
    with pytest.raises(carom.CaromError, match="make it periodic along x too"):
        granular.stress(s, Box(tuple(low), tuple(high), (False, True, True)))
    with pytest.raises(carom.CaromError, match="sheared"):
        granular.heap_angle(s)


def test_fluctuations_are_those_against_the_mean_flow(run: carom.Result) -> None:
    """The same at every frame: the balls keep their velocity against the flow, whatever the flow is."""
    mass, own = (
        np.asarray(run.bodies["mass"]),
        np.asarray(run.velocity[0]) - run.box(0).flow_velocity(run.position[0]),
    )
    away = own - mass @ own / mass.sum()
    for k in (1, len(run.time) - 1):
        s = dataclasses.replace(granular.snapshot(run, k), contacts=NOTHING)
        whole = granular.whole_box(s)
        kinetic = granular.stress(s, whole).kinetic * whole.volume
        assert kinetic == pytest.approx(np.einsum("c,ci,cj->ij", mass, away, away))
        warm = granular.granular_temperature(s)
        assert warm.tensor == pytest.approx(np.cov(own.T, aweights=mass, ddof=0) * 12 / 11)
        assert warm.gradient == pytest.approx(run.box(k).velocity_gradient)
        none = granular.granular_temperature(s, mean="none")
        assert none.tensor == pytest.approx(np.einsum("c,ci,cj->ij", mass, own, own) / mass.sum())
        assert granular.granular_temperature(s, mean="affine").gradient == pytest.approx(
            run.box(k).velocity_gradient, abs=1.0
        )


NOTHING = Contacts(
    *(np.zeros((0, 3) if k in (2, 3) else 0, int if k < 2 else float) for k in range(5)), np.zeros(0, bool)
)


def test_a_region_may_follow_the_box(run: carom.Result) -> None:
    found = granular.over_frames(run, granular.packing_fraction, granular.whole_box)
    volume = 4 / 3 * np.pi * (np.asarray(run.bodies["radius"]) ** 3).sum()
    size = [np.prod(run.box(k).lengths) for k in range(1, len(run.time))]
    assert np.array(found.values) == pytest.approx(volume / np.array(size))


def test_the_whole_box_has_the_balls_where_nothing_repeats() -> None:
    s, _ = sheared(0.0)
    flat = dataclasses.replace(s, box=dataclasses.replace(s.box, lengths=np.array([1.0, 0.0, 1.2])))
    whole = granular.whole_box(flat)
    assert whole.periodic == (True, False, True)
    assert whole.low[1] == pytest.approx(s.position[:, 1].min() - 0.05)
    with pytest.raises(carom.CaromError, match="the world does not repeat"):
        granular.whole_box(dataclasses.replace(s, box=None, period=None))


# ----------------------------------------------------------------------------------------- balls taken over


def test_balls_are_taken_over_with_their_velocity_against_the_flow(run: carom.Result) -> None:
    for frame in (0, -1):
        other = scene(balls=0)
        other.spheres_from(run, frame)
        found = np.array([ball.velocity for ball in other.spheres])
        own = np.asarray(run.velocity[0]) - run.box(0).flow_velocity(run.position[0])
        assert found == pytest.approx(own, abs=1e-9)
        assert np.array_equal([ball.position for ball in other.spheres], run.position[frame])


# ----------------------------------------------------------------------------------------- exports and pictures


def test_gsd_has_the_tilt_of_each_frame(run: carom.Result, tmp_path: Path) -> None:
    hoomd = pytest.importorskip("gsd.hoomd", reason="the extra [export] is not installed")
    with hoomd.open(str(run.export(tmp_path, "gsd")[0])) as file:
        for k, frame in enumerate(file):
            lx, ly, lz, xy, xz, yz = map(float, frame.configuration.box)
            box = run.box(k)
            assert (lx, ly, lz) == pytest.approx(tuple(box.lengths))
            assert (xy, yz) == (0.0, 0.0)
            assert abs(xz * lz) <= 0.5 * lx * (1 + 1e-6)
            vectors = np.array([[lx, 0, 0], [0, ly, 0], [xz * lz, 0, lz]])
            # The same images: each vector of the run is a whole number of those of the file.
            whole = np.linalg.solve(vectors.T, box.vectors.T)
            assert whole == pytest.approx(np.rint(whole), abs=1e-5)
            place = np.asarray(frame.particles.position)
            assert np.abs(np.linalg.solve(vectors.T, place.T)).max() <= 0.5 + 1e-6
            back = place + frame.particles.image @ vectors + frame.log["configuration/origin"]
            assert back == pytest.approx(np.asarray(run.position[k]), abs=1e-5)


def test_gsd_refuses_a_shear_that_it_cannot_hold(tmp_path: Path) -> None:
    pytest.importorskip("gsd.hoomd", reason="the extra [export] is not installed")
    other = deformed(scene(shear="7*t", flow="z", gradient="x"))
    with pytest.raises(carom.CaromError, match="no box that is sheared along z across x"):
        other.export(tmp_path, "gsd")
    deformed(scene(stretch=("1-t", 1, 1))).export(tmp_path, "gsd")


@pytest.mark.parametrize(("flow", "gradient"), [("x", "z"), ("z", "x")])
def test_extxyz_has_the_lattice_of_each_frame(tmp_path: Path, flow: str, gradient: str) -> None:
    run = deformed(scene(shear="7*t", flow=flow, gradient=gradient))
    text = run.export(tmp_path, "extxyz")[0].read_text()
    heads = re.findall(r'Lattice="(.*?)" Origin="(.*?)" pbc="T T T"', text)
    assert len(heads) == len(run.time)
    for k, (lattice, origin) in enumerate(heads):
        box = run.box(k).tilted
        vectors = np.array([float(x) for x in lattice.split()]).reshape(3, 3)
        assert np.array_equal(vectors, box.vectors)
        corner = np.array([float(x) for x in origin.split()])
        assert corner + 0.5 * vectors.sum(axis=0) == pytest.approx(CENTRE)


def test_a_film_shows_the_sheared_box(run: carom.Result, tmp_path: Path) -> None:
    pytest.importorskip("vtkmodules", reason="the extra [film] is not installed")
    image = pytest.importorskip("PIL.Image", reason="needs pillow")
    pictures = []
    for name, what in (("sheared", run), ("level", deformed(scene(stretch=(1, 1, "1 + 1e-9*t"))))):
        path = what.export(tmp_path / name, "png", at=0.1, width=480, height=360, camera="side", stamp=False)[
            0
        ]
        pictures.append(np.asarray(image.open(path).convert("L")).astype(int))
    assert np.abs(pictures[0] - pictures[1]).max() > 50


def test_the_live_view_keeps_balls_in_the_sheared_box(run: carom.Result) -> None:
    from carom.show.viewer.live import Live

    live = object.__new__(Live)  # without its server
    live._result, live._every, live._scale, live._ends = run, 1, 2.0, (np.zeros(3), np.zeros(3))
    for k in range(len(run.time)):
        box = run.box(k).tilted
        part = np.linalg.solve(box.vectors.T, (0.5 * live._bodies(k)[0] - box.centre).T)
        assert np.abs(part).max() <= 0.5 + 1e-9
        ends = live._corners(k)
        lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        assert np.sort(lengths) == pytest.approx(np.sort(np.repeat(2 * np.linalg.norm(box.vectors, axis=1), 4)))


@pytest.mark.skipif(find_browser() is None, reason="needs a Chromium")
def test_the_page_draws_the_sheared_box_and_keeps_the_balls_in_it(run: carom.Result, tmp_path: Path) -> None:
    path = write_html(run, tmp_path / "view.html").path
    with Browser(size=(700, 500)) as browser:
        browser.open(path)
        for t in (0.0, 0.05, 0.12, 0.2):
            browser.evaluate(f"carom.setTime({t})")
            state = browser.evaluate("carom.state()")
            box = run.boxes.at(t).tilted
            assert state["box"]["lengths"] == pytest.approx(box.lengths.tolist())
            assert state["box"]["tilt"] == pytest.approx(box.offset, abs=1e-12)
            part = np.linalg.solve(box.vectors.T, (np.array(state["centres"]) - box.centre).T)
            assert np.abs(part).max() <= 0.5 + 1e-3
            # What is on the screen where the edges are is darker than what is beside it.
            image = pixels(browser)
            corners = box.corners(np.zeros(3), np.zeros(3))
            edges = [(corners[i] + corners[i | 1]) / 2 for i in (0, 2, 4, 6)]
            points = [browser.evaluate(f"carom.project({p.tolist()})") for p in edges]
            for x, y in points:
                assert around(image, x, y).min() < np.median(around(image, x, y)) - 6


def pixels(browser: Browser) -> np.ndarray:
    image = pytest.importorskip("PIL.Image", reason="needs pillow (comes with matplotlib)")
    return np.asarray(image.open(io.BytesIO(browser.picture())).convert("L")).astype(int)


def around(image: np.ndarray, x: float, y: float) -> np.ndarray:
    """The pixels near a place."""
    return image[max(0, round(y) - 4) : round(y) + 5, max(0, round(x) - 4) : round(x) + 5]
