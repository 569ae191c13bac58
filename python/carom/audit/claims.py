"""What `run.json` and the attributes of the results claim, against what the tables show.

    identity            that of the scenario beside it: a change of an option or a body changes it
    status, outcome     the last step; a run that is done has come to the end that its scenario asks for, one that is running
                        tells nothing of an end
    summary             counts, largest and mean values, energies and final states, from /steps and the last frame
    frames              every multiple of `every` up to the last step has one

Times that the computing took, versions and dates are in no table: nothing tells whether they are true.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from carom.audit import rigid
from carom.audit.data import Run
from carom.audit.formula import law
from carom.audit.references import at
from carom.audit.report import Tally
from carom.audit.vectors import EPS, norm
from carom.result.kinematics import QUANTITIES
from carom.scene.assembly.arrays import identify

Claim = tuple[str, Any, Any, float]
"""Where it is claimed, what is, what the tables show, and how far these may be apart."""

ENDED = ("done", "stopped", "interrupted")
#: Key of the summary -> column of /steps that it sums up or takes the largest of.
COUNTS = ("fallbacks", "unconverged", "halvings", "substeps", "handovers", "entered", "removed")
SUMS = {name: name for name in COUNTS} | {
    "missed_impacts": "missed_impacts",
    "relisted": "relisted",
    "truncated_sequences": "truncated",
}
LARGEST = {
    "residual_position_max": "residual_position",
    "residual_velocity_max": "residual_velocity",
    "penetration_max": "penetration",
    "penetration_max_relative": "penetration_relative",
    "line_search.position": "line_search_position",
    "line_search.velocity": "line_search_velocity",
}
SPREADS = {
    **{f"iterations.{level}": f"iterations_{level}" for level in ("smooth", "position", "velocity")},
    "impact_problems": "impact_problems",
    "contacts": "contacts",
}


def judge(run: Run, tally: Tally) -> None:
    """All claims."""
    about, attributes = run.result._about, run.result._segments.attributes
    if run.opaque:
        tally.skip(
            "claims",
            "the scene has Python functions, of which the identity holds the names alone",
            "give their laws as expressions",
        )
    else:
        known = about.get("scenario", {})
        mine = identify(run.model) in (known.get("identity"), *known.get("earlier", ()))
        tally.measure("claims", [0.0 if mine else np.inf], 0.0, at("run.json: scenario.identity"))
    for name, given in (("step", run.h), ("every", run.every)):
        _compare(tally, (f"results.h5: {name}", attributes[name], given, 0.0))
    for table, kept in (("contacts", run.has_contacts), ("impacts", run.has_impacts)):
        rows = 0 if kept else len(getattr(run.result, table))
        tally.measure(
            "claims", [float(rows)], 0.0, at(f"scenario.toml: record.{table}, of which the results have rows")
        )
    _frames(run, tally)
    claims = [*_ending(run, about)]
    if isinstance(about.get("summary"), Mapping):
        claims += _summary(run, about, about["summary"])
    for claim in claims:
        _compare(tally, claim)


def _frames(run: Run, tally: Tally) -> None:
    last = len(run.steps["step"])
    ended = run.result._about.get("status") != "running"
    until = last if ended else int(run.step[-1]) if run.frames else -1
    wanted = np.arange(0, until + 1, run.every)
    missing = np.setdiff1d(wanted, run.step)
    if ended and run.result._about.get("status") == "done" and last not in run.step:
        missing = np.append(missing, last)
    tally.measure("claims", [float(len(missing))], 0.0, at(f"/frames: those of steps {missing[:3].tolist()}"))


def _ending(run: Run, about: Mapping[str, Any]) -> Iterator[Claim]:
    outcome, last = about.get("outcome") or {}, len(run.steps["step"])
    kind, status = outcome.get("kind"), about.get("status")
    ended = "running" if not outcome else kind if kind in ENDED else "failed"
    yield "status", status, ended, 0.0
    # What ended outside of the steps, or has not ended, has no numbers of an end.
    told = bool(outcome) and kind != "error" and not (kind == "interrupted" and "step" not in outcome)
    yield "summary", isinstance(about.get("summary"), Mapping), told, 0.0
    if not outcome:
        yield "finished", about.get("finished"), None, 0.0
    if not told:
        return
    if status in ENDED:
        yield "outcome.step", outcome.get("step"), last, 0.0
        yield "outcome.time", outcome.get("time"), last * run.h, 2.0 * EPS
    if status == "done":
        # Of millions of steps rounding gave builds up to 0.2 one step more.
        ratio = run.until / run.h
        ends = {max(1, math.ceil(ratio - max(1e-9, part * ratio))) for part in (0.0, 1e-15)}
        yield "outcome.step", last, last if last in ends else min(ends), 0.0
    parts = about.get("segments") or [{}]
    yield "segments: to_step", parts[-1].get("to_step"), last, 0.0


def _summary(run: Run, about: Mapping[str, Any], told: Mapping[str, Any]) -> Iterator[Claim]:
    s, steps = run.steps, len(run.steps["step"])

    def claim(key: str, shown: Any, bound: float = 0.0) -> Claim:
        found: Any = told
        for part in key.split("."):
            found = found.get(part) if isinstance(found, Mapping) else None
        return f"summary.{key}", found, shown, bound

    scenario = about.get("scenario", {})
    outcome = about.get("outcome") or {}
    events = run.result.events
    begun = np.asarray(events["kind"])[np.asarray(events["step"]) == 0] if len(events) else np.zeros(0)
    # What enters or leaves before the first step is in no row of /steps.
    first = {"entered": int((begun == 1).sum()), "removed": int((begun == 0).sum())}
    yield claim("scenario", scenario.get("file") or scenario.get("title"))
    for key in ("title", "case", "parameters"):
        if key in scenario:
            yield claim(key, scenario[key])
    yield claim("failure", None if about.get("status") in ENDED else outcome)
    for key, shown in (
        ("method", run.method),
        ("step", run.h),
        ("steps", steps),
        ("bodies_count", run.balls),
    ):
        yield claim(key, shown)
    yield claim("time", steps * run.h, 2.0 * EPS)
    yield claim("outcome", outcome.get("kind"))
    for key in ("wall_s", "core_s"):
        yield claim(key, sum(part.get(key, 0.0) for part in about.get("segments", ())), 16.0 * EPS)
    for key, column in SUMS.items():
        yield claim(key, int(s[column].sum()) + first.get(key, 0))
    yield claim("stepped", float(s["stepped"].sum()), steps * EPS)
    for key, column in LARGEST.items():
        yield claim(key, s[column].max(initial=0))
    for key, column in SPREADS.items():
        yield claim(f"{key}.max", s[column].max(initial=0))
        yield claim(f"{key}.mean", s[column].sum() / max(1, steps), 4.0 * EPS)
    yield claim("restitution_scale_min", s["restitution_scale"].min(initial=1.0))
    yield claim("safeguarded", int((s["restitution_scale"] < 1.0).sum()))
    for key, column in (("work", "energy_work"), ("in", "energy_in"), ("out", "energy_out")):
        size = np.abs(s[column]).sum()
        yield claim(f"energy.{key}", s[column].sum(), EPS * steps * size / max(abs(s[column].sum()), 1e-300))
    if steps:
        yield from (claim(key, shown, bound) for key, shown, bound in _energies(run, told))
    if run.every == 1 and not len(run.result.events):
        yield claim("travel_max", _travel(run), 8.0 * EPS)
    bodies = told.get("bodies")
    if isinstance(bodies, Mapping) and run.frames and int(run.step[-1]) == steps:
        present = np.asarray(run.result.present[-1])
        for name in QUANTITIES:
            last = np.asarray(getattr(run.result, name)[-1])
            for k in np.flatnonzero(present):
                body = bodies.get(run.names[k])
                found = body.get(name) if isinstance(body, Mapping) else None
                yield f"summary.bodies.{run.names[k]}.{name}", found, last[k].tolist(), 0.0


def _travel(run: Run) -> float:
    """The largest way of a body in a step after the first frame, over its radius: of a clump over its reach."""
    found = float((run.top_speeds_later * run.h / run.radius).max(initial=0.0))
    for first in range(1, run.frames if run.clumps else 0, 100_000):
        speed = norm(np.nan_to_num(run.motion_of_clumps(slice(first, first + 100_000))[..., 7:10]))
        found = max(found, float((speed * run.h / run.clumps.reach).max(initial=0.0)))
    return found


def _energies(run: Run, told: Mapping[str, Any]) -> Iterator[tuple[str, Any, float]]:
    """Energy at both ends, and what rose in between."""
    s = run.steps
    total = s["energy_kinetic"] + s["energy_potential"]
    yield "energy.final", total[-1], 0.0
    energy = told.get("energy")
    first = energy.get("initial") if isinstance(energy, Mapping) else None
    if not isinstance(first, float | int) or len(run.result.events) or int(run.step[0]) != 0:
        return
    x, v, w = (of[0] for of in run.state(slice(0, 1))[:3])
    rows = run.motion_of_clumps(slice(0, 1))[0]
    here = run.present(slice(0, 1))[0]
    of_bodies = rigid.kinetic(run, v, w, rows), rigid.weight(run, x, rows)
    motion, height = (np.where(here, of_body, 0.0) for of_body in of_bodies)
    if not run.loads and run.method != "penalty":  # whose springs and contacts have a potential, too
        shown, size = motion.sum() - height.sum(), (motion + np.abs(height)).sum()
        yield "energy.initial", shown, 64.0 * EPS * run.bodies * size / max(abs(shown), 1e-300)
    before = np.concatenate([[first], total[:-1]])
    rise = total - before - s["energy_work"] - (s["energy_in"] - s["energy_out"])
    largest = max(0.0, float(rise.max()))
    rounding = 8.0 * EPS * np.abs(total).max() / max(largest, 1e-300)
    yield "energy.max_rise", largest, rounding
    pulls = run.mass * np.linalg.norm(run.gravity)
    for body, wall in enumerate(run.free_walls, run.balls):  # these have their force besides, along one line
        force = float(law(wall.force, np.zeros(1))[0][0] * run.areas[body - run.balls][0])
        pulls[body] = abs(wall.mass * float(wall.fall(run.gravity) @ wall.normal) + force)
    lengths = run.radius.copy()
    pulls[run.clumps.balls] = 0.0
    pulls[run.clumps.first] = run.clumps.mass * np.linalg.norm(run.gravity)
    lengths[run.clumps.first] = run.clumps.reach
    floor = float((pulls * lengths).sum())
    scale = np.maximum(np.maximum.accumulate(s["energy_kinetic"]), motion.sum()) + floor
    relative = largest / max(scale[-1], 1e-300)
    # What loads give in a step, which the scale has besides, is on no record where they hang on the motion.
    loaded = bool(run.model.get("loads"))
    if loaded and isinstance(energy, Mapping) and isinstance(energy.get("max_rise_relative"), int | float):
        relative = min(relative, max(0.0, energy["max_rise_relative"]))
    yield "energy.max_rise_relative", relative, rounding + 1e-12
    # A rise that is at the bound may count or not: scales are sums of another order.
    bound, slack = 1e-12 * scale + 16.0 * EPS * np.abs(s["energy_potential"]), 8.0 * EPS * np.abs(total)
    least, most = (int((rise > bound * (1.0 + d) + d * 1e9 * slack).sum()) for d in (1e-9, -1e-9))
    yield (
        "energy.rises",
        min(max(energy["rises"], 0 if loaded else least), most)
        if isinstance(energy, Mapping) and isinstance(energy.get("rises"), int)
        else least,
        0.0,
    )


def _compare(tally: Tally, claim: Claim) -> None:
    where, told, shown, bound = claim
    if isinstance(shown, (bool, str, dict, type(None))):
        off = 0.0 if told == shown else np.inf
    else:
        try:
            told, shown = np.asarray(told, dtype=np.float64), np.asarray(shown, dtype=np.float64)
            apart = np.abs(told - shown).max() if told.shape == shown.shape else np.inf
            off = 0.0 if apart == 0.0 else float(apart / max(float(np.abs(shown).max()), 1e-300))
        except (TypeError, ValueError, OverflowError):  # a whole number beyond all floats among them
            off = np.inf
    tally.measure("claims", [off], bound, at(f"run.json: {where}" if ":" not in where else where))
