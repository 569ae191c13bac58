"""The page that `carom view` writes: nothing in it can ask the network, and its data are the run's."""

from __future__ import annotations

import base64
import gzip
import hashlib
import json
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from carom import CaromError, CaromWarning, Scene, load, simulate
from carom.show.viewer import codec, write_html
from carom.show.viewer import page as view_page
from carom.show.viewer.page import MIN_FRAMES
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from view_scenes import Shown, billiard, drum, turn

ROOT = Path(__file__).parents[1]
ASSETS = ROOT / "python" / "carom" / "show" / "viewer" / "assets"


@dataclass
class Page:
    """A written page, read back with Python alone."""

    text: str
    facts: dict[str, Any] = field(init=False)
    data: bytes = field(init=False)

    def __post_init__(self) -> None:
        self.facts = json.loads(self.element("carom-facts"))
        self.data = gzip.decompress(base64.b64decode(self.element("carom-motion")))

    def element(self, name: str) -> str:
        found = re.search(rf'<script id="{name}"[^>]*>(.*?)</script>', self.text, re.DOTALL)
        assert found, name
        return found[1]

    @property
    def policy(self) -> dict[str, str]:
        found = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', self.text)
        assert found
        return dict(part.strip().split(" ", 1) for part in found[1].split(";"))

    @property
    def time(self) -> Any:
        return np.frombuffer(self.data, "<f8", self.facts["arrays"]["time"]["shape"][0])

    def array(self, name: str) -> Any:
        entry = self.facts["arrays"][name]
        packed = self.data[entry["offset"] : entry["offset"] + entry["bytes"]]
        values = codec.decode(packed, entry).astype(float)
        if name == "orientation":
            return (values / np.linalg.norm(values, axis=-1, keepdims=True))[..., [3, 0, 1, 2]]
        return values * entry["step"] + np.asarray(entry.get("origin", 0.0))

    def array_of_flags(self, name: str) -> Any:
        entry = self.facts["arrays"][name]
        return codec.decode(self.data[entry["offset"] : entry["offset"] + entry["bytes"]], entry).astype(bool)


def write(result: Any, folder: Path, **options: Any) -> tuple[Any, Page]:
    info = write_html(result, folder / "view.html", **options)
    assert info.bytes == info.path.stat().st_size
    return info, Page(info.path.read_text())


def test_page_cannot_ask_for_anything(tmp_path: Path) -> None:
    _, page = write(billiard(100), tmp_path)
    assert page.policy["default-src"] == "'none'"
    assert set(page.policy) == {
        "default-src",
        "script-src",
        "style-src",
        "img-src",
        "connect-src",
        "base-uri",
        "form-action",
    }
    assert page.policy["img-src"] == "data: blob:"
    assert "unsafe" not in str(page.policy)
    # No attribute of the markup leads out (three.js names its homepage in its licence, as text).
    markup = page.text.replace((ASSETS / "viewer.js").read_text(), "").replace(
        page.element("carom-motion"), ""
    )
    markup = re.sub(r"'sha256-[^']*'", "", markup)  # letters and slashes at random
    assert not re.search(r"https?:|//[a-z]|@import|url\(", markup)
    assert re.findall(r'(?:src|href)="([^"]*)"', markup) == ["data:,"]


def test_policy_allows_exactly_the_program_and_the_style(tmp_path: Path) -> None:
    _, page = write(billiard(100), tmp_path)
    for directive, pattern in (
        ("script-src", r"<script>(.*?)</script>"),
        ("style-src", r"<style>(.*?)</style>"),
    ):
        (content,) = re.findall(pattern, page.text, re.DOTALL)
        digest = base64.b64encode(hashlib.sha256(content.encode()).digest()).decode()
        assert page.policy[directive] == f"'sha256-{digest}'"
    assert ' style="' not in page.text
    assert not re.search(r"<[^>]* on[a-z]+=", page.text.split("<script", 1)[0])


def test_licence_of_three_js_travels_with_the_bundle() -> None:
    for name in ("viewer.js", "NOTICE.txt"):
        text = (ASSETS / name).read_text()
        assert "three.js authors" in text
        assert "Permission is hereby granted, free of charge" in text
    assert (ASSETS / "viewer.js").stat().st_size < 700_000


def test_lock_file_names_no_registry() -> None:
    lock = json.loads((ROOT / "viewer" / "package-lock.json").read_text())
    packages = lock["packages"]
    assert packages["node_modules/three"]["version"] == "0.187.0"
    assert packages["node_modules/esbuild"]["version"] == "0.28.2"
    assert not any("resolved" in package for package in packages.values())


def test_motion_in_the_page_is_the_run(tmp_path: Path) -> None:
    run = billiard(300)
    info, page = write(run, tmp_path, title="A break & more")
    assert (info.frames, info.bodies, info.notes) == (300, 4, ())
    assert page.facts["names"] == run.names
    assert page.facts["radius"] == pytest.approx(run.bodies["radius"])
    assert "<title>A break &amp; more</title>" in page.text
    assert np.array_equal(page.time, run.time)
    assert np.abs(page.array("position") - run.position).max() < 1.01e-5 * 0.028575
    # q and -q are one attitude.
    overlap = np.abs(np.einsum("tnk,tnk->tn", page.array("orientation"), run.orientation))
    assert overlap.min() > 1 - 1e-8
    for name in ("velocity", "angular_velocity"):
        exact = getattr(run, name)
        assert np.abs(page.array(name) - exact).max() <= 0.51 * np.abs(exact).max() / 2**20


def test_attitudes_never_jump_to_the_other_sign(tmp_path: Path) -> None:
    run = billiard(400)
    run.orientation *= np.where(np.arange(400) % 7 < 3, -1.0, 1.0)[:, None, None]
    _, page = write(run, tmp_path)
    q = page.array("orientation")
    assert (np.einsum("tnk,tnk->tn", q[1:], q[:-1]) > 0).all()


@pytest.mark.parametrize("distance", [0.0, 50.0, 5e3])
def test_precision_holds_in_large_scenes(tmp_path: Path, distance: float) -> None:
    run = billiard(200)
    run.position[:, 3, 0] += distance * run.time / run.time[-1]
    _, page = write(run, tmp_path)
    finest = max(1e-5 * 0.028575, distance / 2**32)
    assert np.abs(page.array("position") - run.position).max() <= 1.02 * finest


@settings(max_examples=60, deadline=None)
@given(
    hnp.arrays(
        np.int32,
        hnp.array_shapes(min_dims=3, max_dims=3, max_side=9),
        elements=st.one_of(st.integers(-3, 3), st.integers(-(2**31), 2**31 - 1)),
    )
)
def test_codec_returns_every_integer(values: codec.Integers) -> None:
    data, entry = codec.encode(values)
    assert len(data) == entry["planes"] * values.size
    assert np.array_equal(codec.decode(data, json.loads(json.dumps(entry))), values)


def test_three_thousand_frames_of_four_balls_fit_in_a_mail(tmp_path: Path) -> None:
    info, page = write(billiard(3000), tmp_path)
    assert info.bytes < 1_000_000
    assert "velocity" in page.facts["arrays"]


def test_a_run_too_large_is_thinned_and_says_so(tmp_path: Path) -> None:
    rng = np.random.default_rng(7)
    run = billiard(100)
    run.time = np.linspace(0.0, 1.0, 800)
    run.position = rng.normal(size=(800, 60, 3))  # noise: as bad to compress as can be
    run.velocity = run.angular_velocity = rng.normal(size=(800, 60, 3))
    run.orientation = turn(rng.normal(size=(800, 60, 3)), 1.0)
    run.names = [f"grain{i}" for i in range(60)]
    run.bodies = {"radius": np.full(60, 0.01)}
    info, page = write(run, tmp_path, max_mb=1.2)
    assert info.bytes < 1.2e6
    assert MIN_FRAMES <= info.frames < info.frames_recorded == 800
    assert info.bodies == 60
    assert f"Shows {info.frames} of 800 frames" in info.notes[0]
    assert page.facts["notes"] == list(info.notes)
    assert (page.time[0], page.time[-1]) == (0.0, 1.0)  # the end is never thinned away
    again = np.searchsorted(run.time, page.time)
    assert np.abs(page.array("position") - run.position[again]).max() < 1e-6


def test_a_crowd_too_large_for_a_few_frames_is_thinned_by_bodies(tmp_path: Path) -> None:
    rng = np.random.default_rng(8)
    count = 20_000
    run = billiard(3)
    run.position = rng.normal(size=(3, count, 3))
    run.velocity = run.angular_velocity = np.zeros((3, count, 3))
    run.orientation = turn(rng.normal(size=(3, count, 3)), 1.0)
    run.names = [str(i) for i in range(count)]
    run.bodies = {"radius": np.full(count, 0.01)}
    info, page = write(run, tmp_path, max_mb=1.1)
    assert info.bytes < 1.1e6
    assert info.frames == 3
    assert 0 < info.bodies < info.bodies_recorded == count
    assert f"Shows {info.bodies} of 20000 bodies" in info.notes[0]
    assert len(page.facts["names"]) == info.bodies


def test_a_run_that_did_not_reach_its_end_says_so_first(tmp_path: Path) -> None:
    """The page of a run that failed looked like that of a short one."""
    scene = Scene("stopped", gravity=(0, 0, 0), run={"until": 0.02, "step": 1e-3})
    scene.sphere("a", radius=0.05, mass=1.0, at=(0, 0, 0), material="m")
    scene.load(on="a", force=({"expression": "sqrt(0.01-t)"}, 0, 0))
    with pytest.warns(CaromWarning), pytest.raises(CaromError):
        simulate(scene, out=tmp_path / "run")
    info, page = write(load(tmp_path / "run"), tmp_path)
    assert info.notes[0].startswith("Not finished: load failed at step 10, t = 0.01 s at a (")
    assert page.facts["notes"] == list(info.notes)


def test_names_are_text_and_never_markup(tmp_path: Path) -> None:
    run = billiard(5)
    run.names = ["</script><script>alert(1)</script>", "<!--", "{{program}}", "Kö & \u2028"]
    _, page = write(run, tmp_path, title="</title><script>alert(2)</script>")
    assert page.facts["names"] == run.names
    assert len(re.findall(r"<script", page.text.replace((ASSETS / "viewer.js").read_text(), ""))) == 3


def test_same_run_same_bytes(tmp_path: Path) -> None:
    first, _ = write(billiard(50), tmp_path / "a")
    second, _ = write(billiard(50), tmp_path / "b")
    assert first.path.read_bytes() == second.path.read_bytes()


def test_what_cannot_be_shown_is_said_in_one_line_and_leaves_no_file(tmp_path: Path) -> None:
    run = billiard(5)
    run.position[3, 2, 1] = np.nan
    with pytest.raises(ValueError, match=r"position of ball4 is not a number at t = 0\.006 s"):
        write_html(run, tmp_path / "view.html")
    empty = billiard(5)
    for name in ("time", "position", "orientation", "velocity", "angular_velocity"):
        setattr(empty, name, getattr(empty, name)[:0])
    with pytest.raises(ValueError, match="nothing to show: the run has 0 frames"):
        write_html(empty, tmp_path / "view.html")
    with pytest.raises(ValueError, match="leaves no room"):
        write_html(billiard(5), tmp_path / "view.html", max_mb=0.1)
    assert list(tmp_path.iterdir()) == []


def test_one_frame_without_planes_or_gravity(tmp_path: Path) -> None:
    run = billiard(1)
    still = Shown(**{k: v for k, v in vars(run).items() if k != "gravity"})
    still.planes = {"name": [], "point": [], "normal": []}
    info, page = write(still, tmp_path)
    assert info.frames == 1
    assert page.facts["planes"] == []
    assert page.facts["gravity"] == [0.0, 0.0, -1.0]


def test_walls_poses_and_absent_balls(tmp_path: Path) -> None:
    """Every wall that is no resting plane is in the facts, its pose in the motion; absent balls stay where they were."""
    run = drum(60)
    _, page = write(run, tmp_path)
    walls = {wall["name"]: wall for wall in page.facts["walls"]}
    assert set(walls) == {"back", "front", "table", "drum", "pipe", "stone", "bowl", "funnel"}
    assert page.facts["planes"] == []
    assert (walls["pipe"]["inside"], walls["bowl"]["inside"], walls["funnel"]["end"]) == (False, True, 0.06)
    assert walls["table"]["size"] == [0.7, 0.3]
    place, turn_of = page.array("wall_position"), page.facts["arrays"]["wall_orientation"]
    assert place.shape == (60, 4, 3) == (*turn_of["shape"][:2], 3)
    table = place[:, walls["table"]["pose"]]
    assert np.abs(table - [[0.1, 0.0, -0.15 + 0.02 * np.sin(10 * t)] for t in run.time]).max() < 1e-6
    assert (page.array_of_flags("present")[..., 0] == run.present).all()
    position = page.array("position")
    assert np.abs(position[run.present] - run.position[run.present]).max() < 1e-6
    assert np.abs(position[:20, 0] - run.position[20, 0]).max() < 1e-6
    assert np.abs(position[40:, -1] - run.position[39, -1]).max() < 1e-6


def test_a_run_whose_balls_never_come_is_shown(tmp_path: Path) -> None:
    run = drum(20)
    run.present[:] = False
    run.position[:] = np.nan
    _, page = write(run, tmp_path)
    assert not page.array_of_flags("present").any()


def test_a_position_that_is_lost_is_still_an_error(tmp_path: Path) -> None:
    run = drum(20)
    run.position[15, 3] = np.nan
    with pytest.raises(CaromError, match="position of grain3 is not a number"):
        write(run, tmp_path)


def test_a_page_is_the_same_however_few_frames_are_read_at_a_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All frames of a million balls did not fit the memory before balls were left out."""
    result = billiard(203)
    monkeypatch.setattr(view_page, "MAX_BODY_FRAMES", 300)  # every third frame, and the last
    info = write_html(result, tmp_path / "whole.html")
    assert 60 < info.frames < 203
    for numbers in (1, 40, 1000):
        monkeypatch.setattr(view_page, "READ_NUMBERS", numbers)
        write_html(result, tmp_path / "parts.html")
        assert (tmp_path / "parts.html").read_bytes() == (tmp_path / "whole.html").read_bytes(), numbers
