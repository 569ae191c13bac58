"""Energy of the steps: none may gain any beyond the work on record."""

from __future__ import annotations

import numpy as np

from carom.arrays import F64
from carom.audit import turning, wrenches
from carom.audit.balance import answered
from carom.audit.data import Run
from carom.audit.energy import at_start
from carom.audit.formula import law
from carom.audit.report import Tally
from carom.audit.vectors import EPS, norm
from carom.result.remarks import RISE_PILE

TOUCHED = 6
"""Pairs that a ball touches at most, each counted once for both."""


def rises(run: Run, tally: Tally) -> None:
    """No step may gain energy beyond the work of loads and walls and what bodies bring or take.

    Bounds, with `T` the largest kinetic energy so far and `sum m |g| r`: 1e-12 T for rounding, 2e-10 T of
    the laws that have no sequence (`docs/reference/determinism.md`); in steps with islands of more
    than `dense_contacts` contacts `RISE_PILE (h/1 ms)^2 T`; where balls meet balls, or walls that are not flat or move, the
    position correction lifts what overlaps after the smooth motion, by at most the way of a step: `h |g| sum m |v|`, that is
    `h |g| sqrt(2 K M)` of the kinetic energy `K` and the whole mass `M`, first order in the step (algorithm, section 10),
    less for a clump of one ball that rolls (`turning.rolled`); of the force on a free wall that times the way of the wall.
    Moreau-Jean: `h |g|/2`, or `h F/(2 M)` of a given force, times all impulses that loads and motion can give, for it moves
    bodies by the mean of velocities. Penalty: what its integration swings by, `(pi/resolution)^2/4`. Works of moving walls
    are exact for constant velocities, else off by the share by which these change in the step; those of springs, drag and
    joints by the change of power within it, which the second difference of the kinetic energy shows, and by those of the
    steps before as long as the filter remembers them (`loads.remembered`); in an impact, after which the kinetic energy may
    be what it was, by `grip` of it in a step. What sticks turns in a step in which it is pulled along one line: by the
    third order of that, of Moreau-Jean by the second.
    """
    s, o = run.steps, run.options
    h = run.h
    kinetic, potential, gained = s["energy_kinetic"], s["energy_potential"], s["energy_work"] + s["energy_in"]
    if not len(kinetic):
        return
    # What its springs store at the start is in no frame of `penalty`.
    known = run.frames and int(run.step[0]) == 0 and run.method != "penalty"
    before = np.array(at_start(run) if known else (kinetic[0], potential[0] - (gained - s["energy_out"])[0]))
    kinetic, potential = np.append(before[0], kinetic), np.append(before[1], potential)
    rise = np.diff(kinetic + potential) - (gained - s["energy_out"])
    g, weight = float(norm(run.gravity)), float(run.whole_mass * norm(run.gravity))
    motion = np.maximum(kinetic[1:], kinetic[:-1])
    longest = float(np.append(run.radius, run.clumps.reach).max())
    top = np.maximum.accumulate(motion) + weight * longest
    # Laws of a problem or two leave what their solver does in them, by which nothing after them is bound (R4).
    solved = run.impact_law.problems > 0
    bound = (2e-10 if solved else 1e-12) * top + 16.0 * EPS * np.maximum(
        np.abs(potential[1:]), np.abs(potential[:-1])
    )
    large = s["candidates"] > run.small
    bound = bound + np.where(large, RISE_PILE * (h / 1e-3) ** 2 * top, 0.0)
    round_walls = any(not wall.flat or wall.moves for wall in run.walls)
    if run.bodies > 1 or round_walls:
        bound = bound + turning.lifted(run, motion)
    elif run.clumps:
        bound = bound + turning.rolled(run, motion)
    walls = zip(run.free_walls, run.areas, strict=True)
    pressed = [area[1:] * np.abs(law(wall.force, s["time"])[0]) for wall, area in walls]
    for force, wall in zip(pressed, run.free_walls, strict=True):
        way = h * (np.sqrt(2.0 * motion / wall.mass) + h * force / wall.mass)
        bound = bound + np.where(s["contacts"] > 0, force * way, 0.0)
    if run.method == "moreau":
        loads = [load for load in run.loads if load["kind"] == "force"]
        forces = [norm(wrenches.at_steps(run, tuple(load["force"]))[1:]) for load in loads]
        each = (force / run.heavy[run.node[load["body"]]] for force, load in zip(forces, loads, strict=True))
        pull = np.max([np.full(len(motion), g), *each], axis=0)
        given = 2.0 * np.sqrt(2.0 * motion * run.whole_mass) + (weight + sum(forces)) * h
        bound = bound + 0.5 * h * pull * given
    if run.method == "penalty":
        # Verlet's energy swings by (w dt)^2/8 of itself; a ball between two others has twice the w^2 of its contact.
        bound = bound + 0.25 * (np.pi / float(o["penalty_resolution"])) ** 2 * top
    bound = bound + turning.risen(run, motion) + answered(run) + _unsteady(run) * np.abs(s["energy_work"])
    if run.cohesive:  # a gap counts as touch up to the tolerance, and not beyond
        strongest = float(np.nanmax(run.model["cohesion"]))
        bound = bound + s["candidates"] * strongest * run.loosest["touching_tolerance"] * run.radius.max()
        # What sticks turns in a step, in which it is pulled along one line: of third order. By the motion before, and by
        # what one pull gives; some are twice as fast as the mean.
        fast = 2.0 * np.sqrt(2.0 * kinetic[:-1] / run.whole_mass) + h * strongest / run.mass.min()
        turn = np.minimum(h * fast / run.radius.min(), 1.0)
        bound = bound + s["contacts"] * strongest * h * fast * turn**2
        if (
            run.method == "moreau" and not run.projects
        ):  # what opens by its turn in a step is not pulled in that step
            bound = bound + TOUCHED * run.bodies * strongest * h * fast * turn
        # Of a wall that goes away nothing is torn off.
        gone = sum(~wall.there(s["time"] - 0.5 * h) & wall.there(s["time"] - 1.5 * h) for wall in run.walls)
        bound = bound + gone * run.balls * 0.5 * strongest * float(np.max(run.model["rupture_distance"]))
    tally.measure("energy rise", np.maximum(rise, 0.0), bound, lambda i: run.step_place(i + 1))


def _unsteady(run: Run) -> F64:
    """(S,) largest share by which the velocity of a moving wall changes in a step."""
    end = run.steps["time"]
    found = np.zeros(len(end))
    for wall in run.walls:
        if wall.moves:
            p = np.broadcast_to(wall.point, (len(end), 3))
            old = np.hstack(list(wall.velocity(end - run.h, p)))
            new = np.hstack(list(wall.velocity(end, p, end=True)))
            size = norm(old) + norm(new)
            found = np.maximum(
                found, np.divide(norm(new - old), size, out=np.zeros_like(size), where=size > 0.0)
            )
    return found
