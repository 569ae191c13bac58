"""Names of balls, walls and clumps, and numbers, mean the same in tables, events, figures and parts of a result."""

from __future__ import annotations

from typing import Any

import carom
import numpy as np
import pytest
from carom import CaromError, events

pytestmark = pytest.mark.filterwarnings("ignore::carom.CaromWarning")


@pytest.fixture(scope="module")
def result() -> carom.Result:
    """A slanting rod of two balls and a ball beside it fall on a floor, and the ball against the rod."""
    scene = carom.Scene("rod", gravity=(0, 0, -9.8), run={"until": 0.3, "step": 1e-3})
    scene.contact("m", "m", friction=0.3, restitution=0.5)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="m")
    scene.sphere("a", radius=0.01, mass=0.01, material="m", at=(0.06, 0, 0.03), velocity=(-0.5, 0, 0))
    spheres = [[-0.008, 0, -0.004, 0.01], [0.008, 0, 0.004, 0.01]]
    scene.clump("rod", spheres=spheres, mass=0.02, position=(0, 0, 0.03), material="m")
    return carom.simulate(scene)


def rows(table: Any) -> list[tuple[float, ...]]:
    """What tells rows from one another, in order."""
    columns = np.column_stack([np.asarray(table[name]) for name in ("time", "body", "impulse")])
    return sorted(map(tuple, columns.tolist()))


def test_the_name_of_a_clump_means_its_balls(result: carom.Result) -> None:
    balls = result.clumps["rod"].balls
    for table in (result.impacts, result.contacts):
        assert rows(table.between("rod")) == sorted(
            row for ball in balls for row in rows(table.between(ball))
        )
        for other in ("floor", "a"):
            met = rows(table.between(other, "rod"))
            assert met == sorted(row for ball in balls for row in rows(table.between(ball, other)))
            assert met == rows(table.between("rod", other))
    assert len(result.impacts.between("rod", "floor")) > 0 < len(result.impacts.between("a", "rod"))
    found = [event for ball in balls if (event := events.first_contact(result, ball, "floor"))]
    assert len(found) == 2
    assert events.first_contact(result, "floor", "rod") == min(found, key=lambda event: event.time)
    part = result.sel(body="rod")
    assert part.names == balls
    assert rows(part.impacts.between("rod")) == rows(result.impacts.between("rod"))


def test_figures_draw_the_balls_of_a_clump(result: carom.Result) -> None:
    pytest.importorskip("matplotlib", reason="the extra [plot] is not installed")
    for draw in (result.plot.velocities, result.plot.heights, result.plot.trajectories):
        for chosen in ("rod", ["rod"], [1, 2]):
            [legend] = draw(chosen).legends
            assert [text.get_text() for text in legend.get_texts()] == result.clumps["rod"].balls


def test_numbers_are_those_of_the_column_body(result: carom.Result) -> None:
    known = [*result.names, *result.wall_names]
    for number, name in enumerate(known):
        assert rows(result.impacts.between(number)) == rows(result.impacts.between(name))
    assert rows(result.impacts.between(np.int64(0), 3)) == rows(result.impacts.between("a", "floor"))
    for wrong in (-1, 4, 1.5, "rood", None):
        with pytest.raises(KeyError, match=f"no body, wall or clump is called {wrong!r}"):
            result.impacts.between(wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize(("first", "second"), [("a", "a"), ("rod", "rod"), ("rod", "rod1"), (0, "a")])
def test_a_contact_is_of_two(result: carom.Result, first: Any, second: Any) -> None:
    """All rows of a ball were given for it with itself."""
    for found in (result.impacts.between, lambda a, b: events.first_contact(result, a, b)):
        with pytest.raises(CaromError, match=f"{first!r} and {second!r} are one body; a contact is of two"):
            found(first, second)


def test_nothing_happened_to_anybody_in_a_table_without_rows(result: carom.Result) -> None:
    assert len(result.transitions.between("rod")) == len(result.impulses.between("a", "floor")) == 0


def test_a_time_outside_of_a_run_is_told_from_its_end(result: carom.Result) -> None:
    with pytest.raises(
        CaromError, match=r"sel: 0\.3000001 s is outside of the frames; give times from 0 to 0\.3 s"
    ):
        result.sel(time=0.3000001)
