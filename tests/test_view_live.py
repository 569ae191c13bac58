"""The live view: shapes always; the server where viser is installed (extra `live`), which is on this machine only."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest
from carom import CaromError
from carom.show.viewer.live import HOST
from carom.show.viewer.live_shapes import ball_halves


def area_vectors(vertices: Any, faces: Any) -> Any:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return 0.5 * np.cross(b - a, c - a)


def test_the_halves_of_a_ball_are_one_closed_sphere_seen_from_outside() -> None:
    total = np.zeros(3)
    volume = 0.0
    for _, vertices, faces in ball_halves():
        assert np.linalg.norm(vertices, axis=1) == pytest.approx(1.0)
        vectors = area_vectors(vertices, faces)
        middle = vertices[faces].mean(axis=1)
        total += vectors.sum(axis=0)
        volume += (middle * vectors).sum() / 3
    assert np.abs(total).max() < 1e-12
    assert volume == pytest.approx(4 / 3 * np.pi, rel=0.06)  # inscribed, hence less


def test_without_viser_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    from carom.show.viewer.live import Live

    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(CaromError, match=r"pip install 'carom\[live\]'"):
        Live(tmp_path)


def test_ctrl_c_is_how_serving_ends(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """With 0, as `carom play` does: see the exit codes of docs/reference/cli.md."""
    pytest.importorskip("viser", reason="needs viser (extra live)")
    from carom.cli import main
    from carom.show.viewer.live import Live

    def pressed(_: Live) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Live, "wait", pressed)
    carom.simulate(carom.example("three_balls"), until=1e-2, out=tmp_path / "run")
    with pytest.raises(SystemExit) as left:
        main(["view", str(tmp_path / "run"), "--live", "--port", "8097"])
    assert left.value.code == 0
    assert "Ctrl-C ends it" in capsys.readouterr().out


def test_a_port_that_is_taken_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("viser", reason="needs viser (extra live)")
    import socket

    from carom.cli import main

    carom.simulate(carom.example("three_balls"), until=1e-2, out=tmp_path / "run")
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = str(other.getsockname()[1])
        with pytest.raises(SystemExit) as left:
            main(["view", str(tmp_path / "run"), "--live", "--port", port])
    assert left.value.code == 2
    told = capsys.readouterr()
    assert f"carom: port {port} cannot be used" in told.err
    assert "give another with --port (port=)" in told.err
    assert not told.out


@pytest.mark.long
def test_a_run_is_followed_while_it_is_computed(tmp_path: Path) -> None:
    pytest.importorskip("viser", reason="needs viser (extra live)")
    from carom.show.viewer.live import Live

    run = tmp_path / "run"
    program = (
        "import sys, time, carom\n"
        "scene = carom.Scene.from_toml(sys.argv[1])\n"
        "carom.simulate(scene, out=sys.argv[2], callback=lambda *_: time.sleep(0.002))\n"
    )
    scene = Path(carom.__file__).parent / "scenarios" / "paper" / "5.6_break.toml"
    simulation = subprocess.Popen([sys.executable, "-c", program, str(scene), str(run)], env=dict(os.environ))
    try:
        deadline = time.monotonic() + 60
        while not (run / "results.h5").exists() or not _frames(run):
            assert time.monotonic() < deadline
            time.sleep(0.1)
        with Live(run, port=8095) as live:
            first = live.frames
            with urllib.request.urlopen(live.url) as answer:
                assert answer.status == 200
            while live.frames == first:
                assert time.monotonic() < deadline
                time.sleep(0.1)
            assert simulation.poll() is None  # it grew while the run was computed
            time.sleep(0.5)
            assert live.frame == live.frames - 1
            live.show(0)
            assert live.frame == 0
            names = {thread.name for thread in threading.enumerate()}
            assert "carom-live" in names
    finally:
        simulation.kill()
        simulation.wait()


def _frames(run: Path) -> int:
    try:
        import warnings

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with carom.load(run) as result:
                return len(result.time)
    except (CaromError, OSError):
        return 0


def test_who_does_not_know_the_address_gets_no_answer(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("viser", reason="needs viser (extra live)")
    import viser
    from carom.show.viewer.live import Live
    from websockets.exceptions import InvalidStatus
    from websockets.sync.client import connect

    scene = Path(carom.__file__).parent / "scenarios" / "three_balls.toml"
    carom.simulate(str(scene), out=tmp_path / "run")
    with Live(tmp_path / "run", port=0) as live:
        assert not capsys.readouterr().out  # viser would name an address without the token
        bare, token = live.url.rstrip("/").rsplit("/", 1)
        host = bare.removeprefix("http://")
        port = host.rpartition(":")[2]

        def page(url: str, **headers: str) -> int:
            try:
                with urllib.request.urlopen(urllib.request.Request(url, headers=headers)) as answer:
                    assert b"<html" in answer.read()
                    return int(answer.status)
            except urllib.error.HTTPError as error:
                return error.code

        def socket(path: str, **headers: str) -> int:
            try:
                with connect(
                    f"ws://{host}{path}",
                    subprotocols=[f"viser-v{viser.__version__}"],  # type: ignore[list-item]
                    additional_headers=headers,
                ) as opened:
                    return 101 if opened.recv(timeout=5) else 0
            except InvalidStatus as error:
                return error.response.status_code

        assert (page(live.url), socket(f"/{token}")) == (200, 101)
        assert (page(f"http://localhost:{port}/{token}/"), socket(f"/{token}", Origin=bare)) == (200, 101)
        assert [page(bare + path) for path in ("", "/", "/index.html", f"/{token}x/", f"/x?{token}")] == [
            403
        ] * 5
        assert [page(live.url, Host=name) for name in ("evil.example", f"evil.example:{port}")] == [403] * 2
        assert [socket(path) for path in ("", "/", "/x", f"/?{token}")] == [403] * 4
        for origin in ("http://evil.example", f"http://{HOST}:1", "null", f"https://{host}.evil.example"):
            assert socket(f"/{token}", Origin=origin) == 403


def test_a_title_is_text_and_no_markup(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As Markdown, an `onerror` in it ran in the page, and `{x}` or `<5 mm` left it empty."""
    viser = pytest.importorskip("viser", reason="needs viser (extra live)")
    from carom.show.viewer.live import Live

    shown: list[str] = []
    add = viser.GuiApi.add_html

    def record(gui: Any, content: str, **options: Any) -> Any:
        shown.append(content)
        return add(gui, content, **options)

    monkeypatch.setattr(viser.GuiApi, "add_html", record)
    scene = carom.Scene("<5 mm {x} <img src=x onerror=\"alert('x')\"> **a** b_c", run={"until": 0.01})
    scene.sphere("b", radius=0.01, mass=1.0, material="m", position=(0, 0, 1))
    carom.simulate(scene, out=tmp_path / "run")
    with Live(tmp_path / "run", port=0) as live:
        assert "&lt;5 mm {x} &lt;img src=x onerror=&quot;alert(&#x27;x&#x27;)&quot;&gt; **a** b_c" in shown[0]
        assert "t = 0 s, frame 1 of" in live._words.content
