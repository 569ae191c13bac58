"""How tables of the kit and their balls look: the mark in the scene, outlines, surfaces, and what pages hold of them."""

from __future__ import annotations

import base64
import io
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import carom
import numpy as np
import pytest
from browser import Browser, find_browser
from carom import ScenarioError, Scene, billiards
from carom.export.frames import Selection
from carom.scene.billiards.look import COLOURS, IVORY, PLAIN, POOL, ball_looks
from carom.scene.billiards.marked import table_of
from carom.scene.billiards.shape import Shape
from carom.scene.billiards.solid import SURFACES, Part, parts
from carom.scene.billiards.walls import noses
from carom.show.film.look import Look
from carom.show.viewer import codec, write_html
from test_view_page import Page
from view_scenes import billiard

pytestmark = pytest.mark.filterwarnings("ignore::carom.CaromWarning")

KINDS = sorted(billiards.TABLES)
ODD: list[dict[str, Any]] = [
    {"corner_mouth": "150 mm", "side_mouth": "70 mm"},
    {"corner_angle": "90 deg", "side_angle": "140 deg"},
    {"corner_shelf": 0.0, "side_shelf": "75 mm"},
    {"length": "900 mm", "width": "400 mm", "ball_radius": "20 mm", "nose_height": "25 mm"},
    {"corner_mouth": 0.0, "side_mouth": 0.0},
]


@pytest.fixture(scope="module")
def shot(tmp_path_factory: pytest.TempPathFactory) -> carom.Result:
    """A moment of a nine-ball rack on a 9 ft table."""
    table = billiards.table("9ft")
    scene = table.scene("nine-ball", until=0.02, step=1e-3)
    table.rack(scene, 9)
    billiards.strike(table.cue_ball(scene), ball_speed=5.0)
    return carom.simulate(scene, out=tmp_path_factory.mktemp("look") / "run")


# --- the mark --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", KINDS)
def test_a_scene_of_the_kit_and_its_file_say_which_table_it_is(name: str) -> None:
    table = billiards.table(name, nose_height="38 mm")
    scene = table.scene("marked", until=0.1, step=1e-3)
    again = Scene.from_toml(scene.to_toml(resolved=True))
    found = table_of(SimpleNamespace(scene=again))
    assert again.billiard_table == scene.billiard_table
    assert found is not None
    for key, value in vars(table.spec).items():
        if key != "source":
            assert getattr(found.spec, key) == (
                value if isinstance(value, str) else pytest.approx(value, rel=1e-15)
            )


def test_the_mark_moves_no_ball(shot: carom.Result) -> None:
    scene = shot.scene.resolved()
    marked = scene.to_model()
    scene.billiard_table = None
    assert "billiard_table" not in scene.to_toml(resolved=True)
    plain = scene.to_model()
    for key, values in marked.items():
        if isinstance(values, np.ndarray):
            np.testing.assert_array_equal(plain[key], values)
    assert table_of(shot) is not None
    assert Scene("no table").billiard_table is None


@pytest.mark.parametrize("text", ["[billiard_table]", "[billiard_table]\nlength = -1", "[billiard_table", ""])
def test_a_damaged_mark_is_none_and_the_motion_is_still_seen(
    shot: carom.Result, tmp_path: Path, text: str
) -> None:
    copy = shot.save(tmp_path / "copy")
    (copy.path / "scenario.toml").write_text(text)
    assert table_of(copy) is None
    assert "table" not in page(copy, tmp_path / "view.html").facts


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"nose_height": 0.1}, "nose_height must be above"),
        ({"side_mouth": 0.0}, "both"),
        ({"length": -1}, "length"),
    ],
)
def test_measures_that_no_table_has_are_refused(wrong: dict[str, Any], told: str) -> None:
    scene = billiards.table("9ft").scene("t", until=0.1, step=1e-3)
    assert scene.billiard_table is not None
    with pytest.raises(ScenarioError, match=told):
        scene.billiard_table = scene.billiard_table.written() | wrong


# --- outlines and surfaces -------------------------------------------------------------------------------------------


def area(part: Part) -> float:
    """Of a level surface, m^2."""
    a, b, c = (part.points[part.faces[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def surface(shape: Shape, kind: str) -> Part:
    (found,) = (part for part in parts(shape) if part.kind == kind)
    return found


def level(part: Part, z: float) -> Part:
    """The triangles at a height."""
    flat = np.abs(part.points[part.faces][:, :, 2] - z).max(axis=1) < 1e-9
    return Part(part.kind, part.points, part.normals, part.faces[flat])


def farthest(points: np.ndarray, others: np.ndarray) -> float:
    """How far any of `points` (n, 3) is from the nearest of `others`, m."""
    points, others = (np.unique(np.round(some, 9), axis=0) for some in (points, others))
    apart = (np.abs(part[:, None] - others).max(axis=2).min(axis=1) for part in np.array_split(points, 20))
    return float(np.concatenate(list(apart)).max())


@pytest.mark.parametrize("name", KINDS)
def test_tables_are_their_own_mirror_images(name: str) -> None:
    shape = Shape(billiards.table(name))
    lines = {"line"} if name == "snooker" else set()  # the D is at one end
    for part in parts(shape):
        for axis, size in ((0, shape.length), (1, shape.width)):
            if part.kind in lines and axis == 0:
                continue
            mirrored = part.points.copy()
            mirrored[:, axis] = size - mirrored[:, axis]
            assert farthest(mirrored, part.points) < 1e-6, (part.kind, axis)


@pytest.mark.parametrize("name", [n for n in KINDS if n != "carom"])
def test_pockets_are_where_the_kit_takes_balls_out(name: str) -> None:
    table = billiards.table(name)
    shape, spec = Shape(table), table.spec
    assert [hole.name for hole in shape.holes] == list(table.pockets)
    for hole in shape.holes:
        side = hole.name.startswith("side")
        at = np.array(table.pockets[hole.name])
        # The edge of the slate: the shelf behind the middle of the mouth, which in a corner is off the corner.
        edge = spec.side_shelf if side else spec.corner_shelf - 0.5 * spec.corner_mouth
        np.testing.assert_allclose(hole.centre - hole.radius * hole.axis, at + edge * hole.axis, atol=1e-12)
        assert hole.radius > 1.1 * spec.ball_radius
        assert not (0 < hole.centre[0] < spec.length and 0 < hole.centre[1] < spec.width)


@pytest.mark.parametrize("change", [*({"name": name} for name in KINDS), *ODD], ids=str)
def test_bed_and_rails_fill_what_the_pockets_leave(change: dict[str, Any]) -> None:
    change = dict(change)
    shape = Shape(billiards.table(change.pop("name", "9ft"), **change))
    low, high = shape.box
    for part in parts(shape):
        assert np.isfinite(part.points).all()
        np.testing.assert_allclose(np.linalg.norm(part.normals, axis=1), 1.0, atol=1e-9)
        assert (part.points >= low - 1e-9).all()
        assert (part.points <= high + 0.1 * shape.size).all()
    # Against a fine grid of points, by which a pocket is known to some per cent.
    n = 1000
    x, y = np.meshgrid(*(np.linspace(low[k], high[k], n) for k in (0, 1)), indexing="ij")
    out = np.maximum(np.maximum(-x, x - shape.length), np.maximum(-y, y - shape.width))
    cell = (high - low)[:2].prod() / (n - 1) ** 2
    away = [np.hypot(x - h.centre[0], y - h.centre[1]) - h.radius for h in shape.holes]
    depth = np.minimum.reduce([*away, np.full_like(x, np.inf)])
    sunk = cell * float(np.sum((depth < 0) & (out < shape.cushion)))
    whole = (shape.length + 2 * shape.cushion) * (shape.width + 2 * shape.cushion)
    assert whole - area(surface(shape, "cloth")) == pytest.approx(sunk, rel=0.05, abs=1e-9)
    edge, corner = shape.rail - 0.25 * shape.size, shape.corner - 0.25 * shape.size
    sunk = cell * float(np.sum((depth < 0.5 * shape.liner) & (out > shape.cushion)))
    rails = (shape.length + 2 * edge) * (shape.width + 2 * edge) - (4 - math.pi) * corner**2 - whole
    wood = area(level(surface(shape, "wood"), shape.top))
    assert rails - wood == pytest.approx(sunk, rel=0.05, abs=1e-4)


@pytest.mark.parametrize("name", [n for n in KINDS if n != "carom"])
@pytest.mark.parametrize(("sideways", "high"), [(0.0, 1.2), (0.4, 0.6)], ids=["middle", "end"])
def test_nobody_sees_through_a_table(name: str, sideways: float, high: float) -> None:
    """Of the picture that an eye above has around the pockets all is covered: beside their liners the ground was seen."""
    shape = Shape(billiards.table(name))
    at = shape.length * np.array([0.5 + sideways, 0.5 * shape.width / shape.length, high])
    corners = np.concatenate([part.points[part.faces] for part in parts(shape)])
    corners = (at + (corners - at) * (at[2] / (at[2] - corners[..., 2]))[..., None])[
        ..., :2
    ]  # as seen on the bed
    for hole in (hole for hole in shape.holes if hole.name.endswith("right")):  # the left ones mirror them
        reach = hole.radius + 1.5 * shape.liner
        grid = hole.centre + reach * np.stack(np.meshgrid(*2 * [np.linspace(-1, 1, 80)]), axis=-1).reshape(
            -1, 2
        )
        near = (corners.max(axis=1) > hole.centre - reach).all(axis=1)
        near &= (corners.min(axis=1) < hole.centre + reach).all(axis=1)
        covered = np.zeros(len(grid), dtype=bool)
        for a, b, c in corners[near]:
            sides = [
                (q - p)[0] * (grid - p)[:, 1] - (q - p)[1] * (grid - p)[:, 0]
                for p, q in ((a, b), (b, c), (c, a))
            ]
            covered |= (np.min(sides, axis=0) >= -1e-15) | (np.max(sides, axis=0) <= 1e-15)
        assert covered.all(), (hole.name, grid[~covered] - hole.centre)


@pytest.mark.parametrize("name", KINDS)
def test_rubber_ends_at_the_noses_that_balls_meet(name: str) -> None:
    table = billiards.table(name)
    shape = Shape(table)
    lines = [(a, b) for key, a, b in noses(table.spec) if key.startswith("cushion")]
    assert len(shape.cushions) == len(lines)
    rubber = surface(shape, "cushion").points
    inside = (rubber[:, 0] > 1e-9) & (rubber[:, 0] < shape.length - 1e-9)
    inside &= (rubber[:, 1] > 1e-9) & (rubber[:, 1] < shape.width - 1e-9)
    assert not inside.any()
    tips = rubber[np.abs(rubber[:, 2] - shape.nose) < 1e-9]
    for a, b in lines:
        for end in (a, b):
            assert np.hypot(*(tips[:, :2] - end).T).min() < 1e-9
    assert shape.nose == table.spec.nose_height


def test_sights_are_where_the_rules_have_them() -> None:
    shape = Shape(billiards.table("9ft"))
    middles = np.array([sight.mean(axis=0) for sight in shape.sights])
    assert len(middles) == 18  # three on each short rail, six on each long one
    long = middles[middles[:, 1] < 0]
    np.testing.assert_allclose(np.sort(long[:, 0]), np.array([1, 2, 3, 5, 6, 7]) / 8 * shape.length)
    assert -long[0, 1] == pytest.approx(0.0937, abs=1e-3)  # WPA: 3 11/16 in from the nose
    assert len(Shape(billiards.table("carom")).sights) == 20
    assert not Shape(billiards.table("snooker")).sights


# --- balls -----------------------------------------------------------------------------------------------------------


def looks(names: list[str], table: str | None) -> list[tuple[str, str, str]]:
    run = SimpleNamespace(names=names, velocity=np.zeros((1, len(names), 3)))
    found = ball_looks(run, None if table is None else billiards.table(table))
    return [(look.kind, look.colour, look.label) for look in found]


def test_balls_have_the_colours_of_their_game() -> None:
    pool = looks(["cue", *(str(k) for k in range(1, 16))], "8ft")
    assert pool[0][0] == "cue"
    assert [kind for kind, _, _ in pool[1:]] == ["solid"] * 8 + ["stripe"] * 7
    assert [colour for _, colour, _ in pool[1:]] == [*POOL, *POOL[:7]]
    assert [label for _, _, label in pool[1:]] == [str(k) for k in range(1, 16)]
    snooker = looks(["cue", "1", "15", "pink", "the black"], "snooker")
    assert snooker[1:] == [("dotted", PLAIN[name], "") for name in ("red", "red", "pink", "black")]
    carom_balls = looks(["cue", "1", "2"], "carom")
    assert carom_balls[1:] == [("dotted", PLAIN["yellow"], ""), ("dotted", PLAIN["red"], "")]
    # Elsewhere a name is no colour, and the numbers count.
    assert looks(["red", "b4"], None) == [("solid", POOL[0], "1"), ("solid", POOL[3], "4")]


def test_no_two_balls_have_one_number() -> None:
    """Of eight joints' balls `b1` had the colour and the number of the first, and `b2` those of the second."""
    names = ["line", "plane", "lock", "mot", "spin", "b1", "b2", "fix"]
    assert [label for _, _, label in looks(names, None)] == ["3", "4", "5", "6", "7", "1", "2", "8"]
    assert {colour for _, colour, _ in looks(names, None)} == set(POOL)
    assert [label for _, _, label in looks(["a2", "b2", "c2", "d"], None)] == ["2", "1", "3", "4"]


# --- pages -----------------------------------------------------------------------------------------------------------


def page(result: Any, path: Path) -> Page:
    return Page(write_html(result, path).path.read_text())


def test_a_page_holds_the_table_and_not_its_walls(shot: carom.Result, tmp_path: Path) -> None:
    written = page(shot, tmp_path / "view.html")
    facts = written.facts
    assert [plane["name"] for plane in facts["planes"]] == ["bed"]
    assert "walls" not in facts
    assert facts["colours"] == {key: list(value) for key, value in COLOURS.items()}
    assert facts["table"]["kinds"] == list(SURFACES)
    assert facts["balls"][:2] == [[1, POOL[0], "1"], [1, POOL[1], "2"]]
    assert facts["balls"][-1][0] == 0

    def array(name: str) -> Any:
        entry = facts["arrays"][name]
        part = written.data[entry["offset"] : entry["offset"] + entry["bytes"]]
        return codec.decode(part, entry)[:, 0] * entry.get("step", 1)

    made = parts(Shape(billiards.table("9ft")))
    points = np.concatenate([part.points for part in made])
    origin = np.array(facts["arrays"]["position"]["origin"])
    np.testing.assert_allclose(array("table_points") + origin, points, atol=1e-5)
    np.testing.assert_allclose(array("table_normals"), np.concatenate([p.normals for p in made]), atol=1e-3)
    corners = np.asarray(array("table_kinds"))[array("table_faces"), 0]
    assert (corners == corners[:, :1]).all()  # no triangle is of two kinds
    counts = [len(part.faces) for part in made]
    np.testing.assert_array_equal(np.unique(corners[:, 0], return_counts=True)[1], counts)


def test_walls_besides_the_table_stay_and_other_tables_are_drawn_as_before(tmp_path: Path) -> None:
    table = billiards.table("9ft")
    scene = table.scene("a wall on the table", until=0.01, step=1e-3)
    scene.plane("brick", point=(1.0, 0.5, 0.05), normal=(1, 0, 0), size=(0.1, 0.1), material="cushion")
    table.cue_ball(scene)
    facts = page(carom.simulate(scene, out=tmp_path / "run"), tmp_path / "view.html").facts
    assert [wall["name"] for wall in facts["walls"]] == ["brick"]
    facts = page(billiard(3), tmp_path / "other.html").facts
    assert "table" not in facts
    assert len(facts["planes"]) == 5
    assert not any(name.startswith("table") for name in facts["arrays"])
    assert math.isclose(facts["radius"][0], 0.028575)


# --- films -----------------------------------------------------------------------------------------------------------


@pytest.fixture
def drawing() -> None:
    pytest.importorskip("vtkmodules.vtkRenderingOpenGL2", reason="the extra [video] is not installed")
    from carom.show.film import window

    try:
        window._usable()
    except carom.CaromError as error:
        pytest.skip(str(error))


def picture(result: carom.Result, **options: Any) -> np.ndarray:
    from carom.show.film.shoot import pictures

    given = {"width": 640, "height": 360, "stamp": False, "at": 0.0, **options}
    [found] = pictures(Selection.of(result), Look.of("png", given))
    return found.astype(int)


def shade(css: str) -> np.ndarray:
    return np.array([int(css[k : k + 2], 16) for k in (1, 3, 5)])


def rgb(css: str, image: np.ndarray) -> np.ndarray:
    """The pixels of a colour, lighter or darker: (n, 2) rows and columns."""
    wanted = shade(css) / np.linalg.norm(shade(css))
    size = np.linalg.norm(image, axis=-1)
    alike = (image @ wanted) / np.maximum(size, 1) > 0.985
    return np.argwhere(alike & (size > 60))


@pytest.mark.usefixtures("drawing")
class TestFilm:
    def test_the_time_is_read_where_it_stands_on_the_table(self, shot: carom.Result) -> None:
        with_, without = (picture(shot, camera="top", stamp=stamp).mean(axis=-1) for stamp in (True, False))
        changed = np.argwhere(np.abs(with_ - without) > 2)
        box = tuple(
            slice(low, high + 1) for low, high in zip(changed.min(axis=0), changed.max(axis=0), strict=True)
        )
        assert without[box].min() < 120  # wood
        backing, ink = np.quantile(with_[box], [0.5, 0.01])
        assert backing - ink > 100
        assert np.mean(with_[box] > 180) > 0.6

    def test_from_above_the_pockets_are_dark_and_mirror_each_other(self, shot: carom.Result) -> None:
        image = picture(shot, camera="top", shading="plain")
        shape = Shape(billiards.table("9ft"))
        cloth = rgb(COLOURS["cloth"][0], image)
        low, high = cloth.min(axis=0), cloth.max(axis=0)
        # Rows run down where y runs up; the cloth that shows ends where the rubber does.
        scale = (high - low)[::-1] / (np.array([shape.length, shape.width]) + 2 * shape.cushion)
        middle = 0.5 * (low + high)
        for hole in shape.holes:
            off = (hole.centre - 0.5 * np.array([shape.length, shape.width])) * scale
            row, column = np.rint(middle + np.array([-off[1], off[0]])).astype(int)
            assert image[row, column].max() < 40, hole.name
        dark = image.max(axis=-1) < 40
        assert (dark != dark[:, ::-1]).sum() < 0.25 * dark.sum()
        assert (dark != dark[::-1]).sum() < 0.25 * dark.sum()

    def test_balls_have_their_colours_and_stand_where_they_are(self, shot: carom.Result) -> None:
        image = picture(shot, camera="top", shading="plain")
        centres = [rgb(POOL[k], image).mean(axis=0) for k in (1, 3)]  # blue and purple, which nothing else is
        place = shot.position[0][[shot.names.index("2"), shot.names.index("4")]]
        apart = place[1] - place[0]
        moved = (centres[1] - centres[0])[::-1] * (1, -1)
        assert moved[1] / moved[0] == pytest.approx(apart[1] / apart[0], abs=0.15)

    def test_numbers_and_stripes_are_on_balls(self, tmp_path: Path) -> None:
        table = billiards.table("9ft")
        scene = table.scene("apart", until=0.01, step=1e-2)
        for k, name in enumerate(("1", "9")):
            table.ball(scene, name, at=(0.6 + 0.5 * k, 0.6))
        result = carom.simulate(scene, out=tmp_path / "run")
        solid, stripe, plain = (
            picture(result, follow=name, shading=shading)[155:205, 295:345]
            for name, shading in (("1", "pattern"), ("9", "pattern"), ("9", "plain"))
        )
        white = [(part.min(axis=-1) > 175).sum() for part in (solid, stripe, plain)]
        ink = [(part[10:40, 10:40].max(axis=-1) < 90).sum() for part in (solid, stripe, plain)]
        yellow = [len(rgb(POOL[0], part)) for part in (solid, stripe, plain)]
        assert white[0] > 200  # the disc of the number
        assert white[1] > 1.15 * white[0]  # and what is beside the stripe
        assert white[2] < 50  # the lamp alone
        assert ink[1] > 1.5 * ink[0] > 8  # of a 9 there is more than of a 1
        assert ink[2] == 0
        assert yellow[2] > yellow[0] > yellow[1] > 200


# --- figures ---------------------------------------------------------------------------------------------------------


def drawn(axes: Any, gid: str) -> list[Any]:
    return [artist for artist in (*axes.patches, *axes.lines) if artist.get_gid() == gid]


def hexed(artist: Any) -> str:
    from matplotlib.colors import to_hex

    return str(to_hex(artist.get_facecolor()))


def test_paths_are_drawn_on_the_table(shot: carom.Result) -> None:
    pytest.importorskip("matplotlib")
    [axes] = shot.plot.trajectories().axes
    shape = Shape(billiards.table("9ft"))
    counts = {"cushion": 6, "nose": 6, "liner": 6, "sight": 18, "line": 2, "cloth": 1}
    assert {gid: len(drawn(axes, gid)) for gid in counts} == counts
    assert hexed(drawn(axes, "cloth")[0]) == COLOURS["cloth"][0]
    holes = {tuple(np.round(hole.get_center(), 9)) for hole in drawn(axes, "hole")}
    assert holes == {tuple(np.round(hole.centre, 9)) for hole in shape.holes}
    middle = np.array([shape.length, shape.width])
    for flip in ((1, 0), (0, 1)):
        assert {tuple(np.round(np.abs(np.multiply(flip, middle) - h), 9)) for h in holes} == {
            tuple(np.abs(h)) for h in holes
        }
    low, high = shape.box
    assert axes.get_xlim() == pytest.approx((low[0], high[0]), abs=0.02)
    assert axes.get_ylim() == pytest.approx((low[1], high[1]), abs=0.02)
    assert not axes.collections  # none of the rectangles that stand for it


def test_balls_of_a_figure_have_their_colours_and_numbers(shot: carom.Result) -> None:
    pytest.importorskip("matplotlib")
    chart = shot.plot.chart("trajectories")
    [axes] = chart.figure.axes
    assert [hexed(ball) for ball in drawn(axes, "ball solid")] == list(POOL)
    [nine] = drawn(axes, "ball stripe")
    [cue] = drawn(axes, "ball cue")
    assert hexed(nine) == hexed(cue) == IVORY
    assert [hexed(band) for band in drawn(axes, "stripe")] == [POOL[0]]
    assert all(len(drawn(axes, f"number {k}")) == 1 for k in range(1, 10))
    assert len(drawn(axes, "start")) == len(shot.names)
    last = np.asarray(shot.position)[-1]
    np.testing.assert_allclose(nine.get_center(), last[shot.names.index("9"), :2])
    assert nine.get_radius() == shot["9"].radius
    # The number is on its ball, the right way up and round.
    [eight] = drawn(axes, "number 8")
    box = eight.get_path().get_extents()
    np.testing.assert_allclose(box.intervalx.mean(), last[shot.names.index("8"), 0], atol=1e-6)
    assert box.height > box.width
    np.testing.assert_array_equal(
        chart.data["cue x (m)"], np.asarray(shot.position)[:, shot.names.index("cue"), 0]
    )
    [alone] = shot.plot.trajectories(["3"]).axes
    assert [hexed(ball) for ball in drawn(alone, "ball solid")] == [POOL[2]]


def test_a_ball_in_a_pocket_is_pale(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    table = billiards.table("9ft")
    scene = table.scene("straight in", until=0.6, step=1e-3)
    billiards.strike(table.ball(scene, "1", at=(0.3, 0.3)), ball_speed=2.0, direction="225 deg")
    table.ball(scene, "2", at=(1.0, 0.6))
    result = carom.simulate(scene, out=tmp_path / "run")
    assert [found.pocket for found in table.pocketed(result)] == ["head right"]
    [axes] = result.plot.trajectories().axes
    one, two = drawn(axes, "ball solid")
    assert one.get_alpha() < 0.7
    assert two.get_alpha() == 1.0


# --- the page in a browser -------------------------------------------------------------------------------------------


@pytest.mark.skipif(find_browser() is None, reason="needs a Chromium")
def test_the_page_draws_cloth_wood_and_dark_pockets(shot: carom.Result, tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image", reason="needs pillow (comes with matplotlib)")
    with Browser(size=(900, 640)) as browser:
        browser.open(write_html(shot, tmp_path / "view.html").path)
        browser.evaluate("carom.show({impacts: false, trails: 'off'}), carom.view('top')")
        browser.settle()
        data = browser.evaluate("carom.picture()").partition(",")[2]
        places = np.array(browser.evaluate("carom.state()")["screen"])
        errors = [line for line in browser.console if not line.startswith("warning: [.WebGL")]
    assert errors == []
    seen = np.asarray(image.open(io.BytesIO(base64.b64decode(data))).convert("RGB")).astype(int)
    # From two balls, where the view puts other points of the plane of their centres; the rim of a pocket is near it.
    names, at = shot.names, np.asarray(shot.position)[0]
    one, cue = names.index("1"), names.index("cue")
    scale = (places[one, 0] - places[cue, 0]) / (at[one, 0] - at[cue, 0])

    def pixel(x: float, y: float) -> tuple[int, int, int]:
        column = places[cue, 0] + scale * (x - at[cue, 0])
        row = places[cue, 1] - scale * (y - at[cue, 1])
        size = seen.shape[1] / 900  # the picture is sharper than the window
        red, green, blue = seen[int(size * row), int(size * column)]
        return int(red), int(green), int(blue)

    shape = Shape(billiards.table("9ft"))
    for hole in shape.holes:
        assert max(pixel(*hole.centre)) < 45, hole.name
    for x, y in ((0.3, 0.3), (1.0, 1.0), (2.3, 0.2)):
        red, green, blue = pixel(x, y)
        assert green > 1.3 * max(red, blue)
    for x, y in ((0.5, -0.8 * shape.rail), (2.0, shape.width + 0.8 * shape.rail)):
        red, green, blue = pixel(x, y)
        assert red > 1.2 * green > 1.2 * blue
