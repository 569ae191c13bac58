"""`carom play`: shots, the line of aim, undo and saving; who gets an answer. Its page: `test_play_browser.py`."""

from __future__ import annotations

import http.client
import json
import math
import socket
import struct
import time
import urllib.error
import urllib.request
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import carom
import numpy as np
import pytest
from carom import CaromError, billiards
from carom.cli import main
from carom.play.game import CUE, Aim, Game, set_up
from carom.play.server import MOST_BYTES, Server
from carom.play.sight import POINT_S


def two_balls(x: float = 1.5, y: float = 0.635) -> Game:
    """The cue ball on the head spot, one ball straight before it."""
    table = billiards.table("9ft")
    scene = table.scene("two balls")
    table.cue_ball(scene)
    table.ball(scene, "1", at=(x, y))
    return Game(scene)


def lie(game: Game) -> dict[str, tuple[float, ...]]:
    return {ball.name: ball.position for ball in game.scene.spheres}


def distance(line: Any, at: Any) -> float:
    """From a point to a line of many points."""
    moves = np.diff(line, axis=0).any(axis=1)
    start, way = line[:-1][moves], np.diff(line, axis=0)[moves]
    share = np.clip(((at - start) * way).sum(1) / (way**2).sum(1), 0, 1)
    return float(np.linalg.norm(start + share[:, np.newaxis] * way - at, axis=1).min())


def test_the_line_of_aim_is_what_the_shot_then_does() -> None:
    game = two_balls(y=0.66)
    aim = Aim(direction=0.01, speed=2.5, side=0.3, height=-0.3, elevation=0.1)
    sight = game.sight(aim)
    played = game.shoot(aim)
    rows = played.result.transitions.between(CUE, "1")
    ghost = rows.where(rows["pair"][:, 0] == CUE)["position"][0]
    assert sight["hit"] == played.shot.first == "1"
    assert np.abs(np.array(sight["ghost"]) - ghost[:2]).max() < 1e-6  # it is sent in whole micrometres
    assert np.linalg.norm(ghost[:2] - [1.5, 0.66]) == pytest.approx(2 * game.ball(CUE).radius, abs=1e-12)
    assert np.allclose(sight["path"][0], [0.635, 0.635])
    assert sight["path"][-1] == sight["ghost"]
    way, frames = np.array(sight["path"]), played.result
    for t, at in zip(np.asarray(frames.time), np.asarray(frames["cue"].position), strict=True):
        if t < rows["time"][0]:  # all of the way lies on the line, which has corners where the way bends
            assert distance(way, at[:2]) < 0.2 * game.scene.gravity[2] * -(POINT_S**2) / 8


def test_a_line_that_meets_no_ball_says_so() -> None:
    sight = two_balls().sight(Aim(direction=2.0, speed=1.0))
    assert (sight["hit"], sight["ghost"], sight["after"]) == (None, None, {})
    assert len(sight["path"]) > 20


def test_the_line_of_aim_looks_until_the_cue_ball_hits_or_rests() -> None:
    game = two_balls(x=1.45)
    for speed, hit in ((0.42, "1"), (0.3, None)):  # it arrives after three seconds; it stops before
        aim = Aim(speed=speed)
        sight = game.sight(aim)
        shot = game.shoot(aim).shot
        assert sight["hit"] == shot.first == hit
        assert not shot.hits or shot.hits[0].time > 3.0
        if hit is None:
            assert sight["path"][-1] == pytest.approx(game.ball(CUE).position[:2], abs=1e-3)
        game.undo()


def test_a_scene_that_records_no_impacts_can_be_played() -> None:
    table = billiards.table("9ft")
    scene = table.scene(record={"impacts": False})
    table.cue_ball(scene)
    table.ball(scene, "1", at="centre spot")
    assert Game(scene).shoot(Aim()).shot.first == "1"


def test_a_ball_can_be_moved_until_it_touches_another() -> None:
    game = two_balls()
    x, y = game.ball("1").position[:2]
    for angle in np.linspace(0, 6, 50):
        game.place(
            CUE,
            (x + 2 * game.ball(CUE).radius * np.cos(angle), y + 2 * game.ball(CUE).radius * np.sin(angle)),
        )
        assert game.shoot(Aim(direction=angle + np.pi, speed=0.3)).shot.first == "1"
        game.undo()


def test_a_small_ball_lies_where_it_touches_a_large_one() -> None:
    """On the bed centres are 2 sqrt(r1 r2) apart in the plane."""
    t = billiards.table("9ft")
    scene = t.scene(until=1.0)
    t.cue_ball(scene, at=(0.6, 0.6))
    t.ball(scene, "1", at=(1.2, 0.6), radius=0.02)
    apart = 2 * math.sqrt(0.02 * t.spec.ball_radius)
    game = Game(scene)
    game.place("1", (0.6 + apart + 1e-6, 0.6))
    with pytest.raises(CaromError, match="1 would overlap cue"):
        game.place("1", (0.6 + apart - 1e-6, 0.6))


@pytest.mark.parametrize(
    ("height", "low", "high"),
    [(-0.06, -0.1, 0.1), (0.5, 0.5, 2.0), (-0.5, -2.0, -0.3)],
    ids=["stun", "follow", "draw"],
)
def test_stun_follow_and_draw(height: float, low: float, high: float) -> None:
    """A straight shot: the speed at which the cue ball rolls after a full hit is decided by where the tip was."""
    played = two_balls(x=0.95).shoot(Aim(speed=2.2, height=height))
    hit = played.shot.hits[0].time
    rows = played.result.transitions
    rolls = rows.where((rows["event"] == "slip ends") & (rows["pair"][:, 0] == CUE) & (rows["time"] > hit))
    assert low < rolls["velocity"][0, 0] < high


def test_undo_brings_back_the_balls_and_the_aim() -> None:
    game = two_balls()
    start, aim = lie(game), Aim(speed=3.0)
    game.shoot(aim)
    assert lie(game) != start
    game.place("1", (2.0, 0.3))
    assert lie(game)["1"][:2] == (2.0, 0.3)
    assert game.undo() is None
    assert game.undo() == aim
    assert (lie(game), game.shots, game.can_undo) == (start, 0, False)
    with pytest.raises(CaromError, match="nothing to undo"):
        game.undo()


def test_a_saved_shot_plays_again_bit_for_bit(tmp_path: Path) -> None:
    game = Game(set_up("9ft", "9-ball", 1))
    aim = Aim(direction=0.01, speed=8.0, squirt=True, side=0.2)
    before = game.saved(aim)
    played = game.shoot(aim)
    path = tmp_path / "shot-1.toml"
    path.write_text(game.saved(Aim(direction=1.0)), encoding="utf-8")
    assert path.read_text(encoding="utf-8") == before
    again = carom.simulate(str(path), until=float(played.result.time[-1]))
    assert np.array_equal(again.position[-1], played.result.position[-1], equal_nan=True)
    assert Game(carom.Scene.from_toml(path)).scene.names == again.names


def test_a_scratch_puts_the_cue_ball_back_where_nothing_lies() -> None:
    table = billiards.table("9ft")
    scene = table.scene("scratch")
    cue = table.cue_ball(scene, at=(2.2, 0.3))
    table.ball(scene, "1", at="head spot")
    x, y = table.pockets["foot right"]
    game = Game(scene)
    played = game.shoot(Aim(direction=float(np.arctan2(y - 0.3, x - 2.2)), speed=1.5))
    assert played.shot.scratch
    assert "Scratch (foot right)." in played.words
    at = np.array(lie(game)[CUE])
    assert at[0] == table.spots["head spot"][0]
    assert np.linalg.norm(at - lie(game)["1"]) > 2 * cue.radius
    game.shoot(Aim())  # and it can be played from there
    assert (
        "Scratch (off the table)." in two_balls().shoot(Aim(direction=0.3, speed=12.0, elevation=0.7)).words
    )


def test_a_pocketed_ball_is_gone_and_comes_back_by_undo() -> None:
    table = billiards.table("9ft")
    scene = table.scene("pot")
    cue = table.cue_ball(scene, at=(1.9, 0.635))
    ball = table.ball(scene, "7", at=(2.2, 0.9))
    game = Game(scene)
    played = game.shoot(Aim(direction=table.aim(cue, ball, "foot left"), speed=1.5))
    assert [(p.ball, p.pocket) for p in played.shot.pocketed] == [("7", "foot left")]
    assert list(lie(game)) == [CUE]
    assert "7 (foot left)" in played.words
    game.undo()
    assert list(lie(game)) == [CUE, "7"]


def test_what_cannot_be_is_refused_with_words() -> None:
    game = two_balls()
    for given, told in (
        ({"speed": 0.0}, "speed must be above 0"),
        ({"speed": float("nan")}, "finite"),
        ({"spin": 1.0}, 'no "spin"'),
        ({"squirt": 1.0}, "true or false"),
        ({"side": True}, "finite number"),
        ({"side": 10**400}, "finite number, found a whole number of about 400 digits"),
        ({"elevation": 2}, "from 0 to below pi/2 rad, found 2"),
        ([], "JSON object"),
    ):
        with pytest.raises(CaromError, match=told):
            Aim.of(given)
    with pytest.raises(CaromError, match="misses the ball"):
        game.sight(Aim(side=1.2))
    for at, told in (
        ((1.5, 0.6), "overlap 1"),
        ((-1.0, 0.5), "outside"),
        (("a", 0.5), "finite"),
        ((1.0, True), "finite"),
        ((10**400, 0.5), "found .a whole number of about 400"),
    ):
        with pytest.raises(CaromError, match=told):
            game.place(CUE, at)  # type: ignore[arg-type]
    with pytest.raises(CaromError, match='no ball called "9"'):
        game.place("9", (1.0, 0.5))
    assert not game.can_undo
    with pytest.raises(CaromError, match="billiard_table"):
        Game(carom.Scene("nothing"))
    with pytest.raises(CaromError, match="name the cue ball so"):
        Game(billiards.table("9ft").scene())


class Asker:
    """A program that talks to the server as a page does."""

    def __init__(self, url: str) -> None:
        self.url = url

    def __call__(self, what: str, given: Any = None, **headers: str) -> tuple[int, Any]:
        data = given if isinstance(given, bytes | None) else json.dumps(given).encode()
        request = urllib.request.Request(self.url + what, data=data, headers=headers)
        try:
            with urllib.request.urlopen(request, timeout=60) as answer:
                text = answer.read()
                return answer.status, json.loads(text) if text[:1] == b"{" else text
        except urllib.error.HTTPError as error:
            return error.code, json.loads(error.read())


def test_who_does_not_know_the_address_gets_no_answer() -> None:
    with Server(two_balls(), port=0) as server:
        ask = Asker(server.url)
        bare, token = server.url.rstrip("/").rsplit("/", 1)
        host = bare.removeprefix("http://")
        port = host.rpartition(":")[2]
        assert ask("")[0] == ask("state")[0] == ask("undo", {}, Origin=bare)[0] - 200 == 200
        assert Asker(f"http://localhost:{port}/{token}/")("state")[0] == 200
        for path in ("/", "/state", f"/{token}x/state", f"/x/{token}/state"):
            assert Asker(bare)(path)[0] == 403
        for name in ("evil.example", f"evil.example:{port}"):
            assert ask("state", Host=name)[0] == 403
        for origin in ("http://evil.example", "http://127.0.0.1:1", "null", f"https://{host}.evil.example"):
            assert ask("shoot", {"speed": 1.0}, Origin=origin)[0] == 403
        assert server.game.shots == 0


def test_the_server_answers_and_refuses_in_words() -> None:
    with Server(two_balls(), port=0) as server:
        ask = Asker(server.url)
        code, state = ask("state")
        assert (code, sorted(state["balls"]), state["shots"], state["undo"]) == (200, ["1", "cue"], 0, False)
        assert ask("aim", {"direction": 0.0})[1]["hit"] == "1"
        code, state = ask("shoot", {"direction": 0.0, "speed": 2.0})
        assert (code, state["shots"], state["undo"]) == (200, 1, True)
        assert "cue hits 1 first" in state["words"]
        assert b"carom-motion" in ask("table")[1]
        assert ask("save", {})[1]["name"] == "shot-1.toml"
        assert ask("undo", {})[1]["aim"]["speed"] == 2.0
        assert ask("save", {})[1]["name"] == "shot-1.toml"
        for what, given, expected, told in (
            ("aim", {"speed": -1}, 400, "speed must be above 0"),
            ("aim", b"{", 400, "no JSON from its character 2 on"),
            ("aim", b"", 400, "no JSON from its character 1 on"),
            ("aim", b'{"speed": "\xff"}', 400, "no UTF-8 from its byte 12 on"),
            ("aim", b"[" * 9000, 400, "nested too deeply"),
            ("aim", b'{"speed": ' + b"9" * 5000 + b"}", 400, "a number of too many digits"),
            ("place", {"ball": "cue"}, 400, "ball, x and y"),
            ("undo", {}, 400, "nothing to undo"),
            ("elsewhere", {}, 404, "no such request"),
            ("elsewhere", None, 404, "no such page"),
            ("aim", b" " * (MOST_BYTES + 1), 413, "at most"),
            ("aim", b'{"speed": ' + b"9" * 400 + b"}", 400, "a finite number"),
            ("place", b'{"ball": "cue", "y": 0.3, "x": ' + b"9" * 400 + b"}", 400, "two finite numbers"),
        ):
            code, answer = ask(what, given)
            assert code == expected, what
            assert told in answer["error"]


def test_a_length_beyond_all_integers_is_refused() -> None:
    with Server(two_balls(), port=0) as server:
        address = urlsplit(server.url)
        ask = http.client.HTTPConnection(address.netloc, timeout=20)
        ask.request("POST", f"{address.path}aim", headers={"Content-Length": "9" * 5000})
        assert ask.getresponse().status == 413


def test_a_page_that_breaks_off_is_no_error(capfd: pytest.CaptureFixture[str]) -> None:
    with Server(two_balls(), port=0) as server:
        address = urlsplit(server.url)
        for _ in range(5):
            with socket.create_connection((address.hostname, address.port), timeout=20) as page:
                page.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # it resets
                page.sendall(f"POST {address.path}aim HTTP/1.1\r\nHost: {address.netloc}\r\n".encode())
        assert Asker(server.url)("state")[0] == 200
        time.sleep(0.2)
    assert "Traceback" not in capfd.readouterr().err


def test_lines_of_aim_come_as_fast_as_a_screen_draws() -> None:
    """With `-s` it prints how many a second a program gets, and what each costs. The bound allows for slower machines."""
    with Server(Game(set_up("9ft", "9-ball", 1)), port=0) as server:
        host, token = server.url.removeprefix("http://").rstrip("/").split("/")
        connection = http.client.HTTPConnection(host)
        begin, cpu, lines = time.perf_counter(), time.process_time(), 150
        for k in range(lines):
            connection.request("POST", f"/{token}/aim", json.dumps({"direction": -0.1 + 0.0013 * k}))
            assert json.loads(connection.getresponse().read())["path"]
        connection.close()
    cost = (time.process_time() - cpu) / lines
    print(
        f"{lines / (time.perf_counter() - begin):.0f} lines of aim a second, {1e3 * cost:.1f} ms of a core each"
    )
    assert cost < 0.05


def test_a_taken_port_is_named() -> None:
    with Server(two_balls(), port=0) as server:
        port = int(server.url.split(":")[2].split("/")[0])
        with pytest.raises(CaromError, match="--port"):
            Server(two_balls(), port=port)


def test_a_shot_that_is_cut_says_so() -> None:
    """Without losses the balls went on after the last moment, and were taken for ones at rest without a word."""
    table = billiards.table("9ft", corner_mouth=0.0, side_mouth=0.0)
    laws = replace(billiards.LAWS, rolling_deceleration=0.0, cushion_restitution=1.0, cushion_friction=0.0)
    scene = table.scene("no rest", laws=laws)
    table.cue_ball(scene)
    with Server(Game(scene), port=0) as server:
        words = server.answer("/shoot", {"speed": 0.1})["words"]  # type: ignore[index]
    assert (
        words
        == "cue hits no ball. Balls still moved after 60 s: the shot was ended there, and they were stopped."
    )
    assert two_balls().shoot(Aim(speed=0.5)).words == "cue hits 1 first."


@pytest.mark.parametrize(
    ("options", "named"),
    [(["--rack", "8-ball"], "--rack"), (["--table", "7ft", "--seed", "1"], "--table and --seed")],
)
def test_a_scenario_has_its_own_table_and_balls(
    options: list[str], named: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    two_balls().scene.to_toml(tmp_path / "two.toml")
    with pytest.raises(SystemExit, match="2"):
        main(["play", str(tmp_path / "two.toml"), *options])
    assert f"has its own table and balls; leave out {named}, or the scenario" in capsys.readouterr().err


def test_a_scene_that_shots_cannot_take_is_refused_before_the_address_is_printed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The page stayed black: the game was served, and no shot of it could be computed."""
    for add, what in (
        (lambda scene: scene.drag("all", translation=0.5), "springs or loads"),
        (lambda scene: setattr(scene.contacts[1], "friction", "0.2 + exp(-v)"), "friction on a level wall"),
    ):
        scene = two_balls().scene
        add(scene)
        scene.to_toml(tmp_path / "more.toml")
        with pytest.raises(SystemExit, match="2"):
            main(["play", str(tmp_path / "more.toml")])
        told = capsys.readouterr()
        assert told.out == ""
        assert "play: option method events does not know " + what in told.err
        assert "leave them out of the scene" in told.err


def test_a_page_that_shows_another_table_is_refused() -> None:
    """Of two pages on one game the one that stayed behind shot at balls that lay elsewhere by then."""
    with Server(two_balls(), port=0) as server:
        ask = Asker(server.url)
        first = ask("state")[1]["state"]
        assert ask("aim", {"state": first})[0] == 200
        second = ask("place", {"ball": "1", "x": 1.2, "y": 0.9, "state": first})[1]["state"]
        for what, given in (
            ("aim", {}),
            ("shoot", {}),
            ("place", {"ball": "1", "x": 1.3, "y": 0.9}),
            ("undo", {}),
        ):
            code, answer = ask(what, {**given, "state": first})
            assert (code, answer["error"]) == (
                409,
                "The table was changed by another page: it is shown anew.",
            )
        assert lie(server.game)["1"][:2] == (1.2, 0.9)
        third = ask("shoot", {"state": second})[1]["state"]
        back = ask("undo", {"state": third})[1]
        assert len({first, second, third, back["state"]}) == 4  # also where the balls lie as before
        assert back["balls"]["1"] == [1.2, 0.9]
        assert ask("undo", {})[0] == 200  # a program that keeps no number


def test_a_table_that_cannot_be_drawn_is_told(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    with Server(two_balls(), port=0) as server:

        def full() -> bytes:
            raise OSError("No space left on device")

        monkeypatch.setattr(server, "table", full)
        assert Asker(server.url)("table") == (400, {"error": "No space left on device"})
    assert "Traceback" not in capfd.readouterr().err
