"""What is done with an input of each kind, and what may come of it: it is used, or refused in words.

Each target is a function of a scratch folder, and of the folder of `material`, that gives a function of the input. The
latter returns, or raises a `CaromError`; everything else, a panic of the core and a lack of memory among it, is a finding.
"""

from __future__ import annotations

import io
import json
import os
import shutil
import signal
import time
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import carom
import carom.packing
import numpy as np
from carom import CaromError, ScenarioError, Scene, _core
from carom.problem.fclib import read_fclib
from carom.run import checkpoint

from fuzz.material import FILES, RUN

Judge = Callable[[bytes], None]

#: Spheres up to which an accepted scenario is also simulated for a few steps.
SMALL = 400


class Unclear(Exception):
    """An error whose message does not say where, what or how to mend it."""


def judged(judge: Judge, case: bytes) -> tuple[str, str]:
    """The kind of verdict on a case, and what was said."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            judge(case)
    except CaromError as error:
        text = str(error)
        clear = bool(text.strip()) and "Traceback" not in text and "panicked" not in text
        return ("refused", text[:400]) if clear else ("unclear", repr(text[:400]))
    except Unclear as error:
        return "unclear", str(error)[:400]
    except BaseException as error:  # a panic of the core is no Exception
        last = traceback.format_exc().splitlines()[-7:]
        return type(error).__name__, "\n".join(last)
    return "taken", ""


def scenario(folder: Path, base: Path) -> Judge:
    """A scenario file: read, checked, written and read again, and simulated for a few steps where it is small."""
    path = folder / "case.toml"
    carom.packing.MOST_BALLS = 2000  # more are allowed, and take their time

    def judge(case: bytes) -> None:
        path.write_bytes(case)
        try:
            scene = Scene.from_toml(path)
            scene.validate()
        except ScenarioError as error:
            for problem in error.problems:
                if not (problem.where and problem.cause and problem.cure):
                    raise Unclear(f"no place, cause or cure: {problem}") from error
                if len(str(problem).splitlines()) != 1:
                    raise Unclear(f"more than one line: {problem}") from error
            raise
        if len(scene.names) > SMALL:
            return
        again = Scene.from_toml(scene.to_toml())
        if again.to_toml() != scene.to_toml():
            raise Unclear("the scene is not the same after writing and reading it")
        try:
            simulation = _core.Simulation(scene.to_model())
        except _core.ModelError as error:
            raise CaromError(str(error)) from error
        block = simulation.advance(3, 1, True, 1.0)
        outcome = block["outcome"]
        frame = simulation.frame()
        here = frame.get("present", slice(None))
        if outcome is None and not np.isfinite(frame["position"][here]).all():
            raise Unclear("positions are not finite, and nobody said so")
        if outcome is not None and not outcome["advice"]:
            raise Unclear(f"no advice: {outcome}")

    return judge


def problem(folder: Path, base: Path) -> Judge:
    """A contact problem in a file: read, and solved for a moment."""
    path = folder / "case.hdf5"

    def judge(case: bytes) -> None:
        path.write_bytes(case)
        found = carom.ContactProblem(read_fclib(path))
        found.solve(max_iterations=20, time_limit=1.0, on_nonconvergence="return")

    return judge


def result(folder: Path, base: Path) -> Judge:
    """A result: the first byte says which file of the run it replaces, and everything is read."""
    whole, run = base / RUN, folder / "run"

    def judge(case: bytes) -> None:
        shutil.rmtree(run, ignore_errors=True)
        shutil.copytree(whole, run)
        (run / FILES[case[0]]).write_bytes(case[1:])
        with carom.load(run) as found:
            read_all(found)

    return judge


def resumed(folder: Path, base: Path) -> Judge:
    """The same for a run that is continued, to a time that it has not reached."""
    whole, run = base / RUN, folder / "resumed"

    def judge(case: bytes) -> None:
        shutil.rmtree(run, ignore_errors=True)
        shutil.copytree(whole, run)
        (run / FILES[case[0]]).write_bytes(case[1:])
        carom.resume(run, until=0.033).close()

    return judge


def read_all(found: carom.Result) -> None:
    """Reads every column of every table, and what is derived from them."""
    for name in ("time", "step", "position", "orientation", "velocity", "angular_velocity", "present"):
        np.asarray(getattr(found, name))
    for table in (found.steps, found.impacts, found.contacts, found.residuals, found.events):
        for column in table.columns:
            np.asarray(table[column])
    for static in (found.bodies, found.planes):
        for column in static.columns:
            np.asarray(static[column])
    np.asarray(found.energy.total)
    for word in (repr(found), str(found.outcome), found.title, str(found.summary), str(found.versions)):
        assert isinstance(word, str)
    _ = found.names, found.wall_names, found.joint_names, found.gravity, found.periodic, found.parameters
    if found.names:
        np.asarray(found[found.names[0]].speed)


def saved(folder: Path, base: Path) -> Judge:
    """A checkpoint: read, and given to the simulation that it is said to belong to, which goes on."""
    path = folder / "case.npz"
    model = Scene.from_toml(base / RUN / "scenario.toml").to_model()

    def judge(case: bytes) -> None:
        path.write_bytes(case)
        found = checkpoint.load(path)
        simulation = _core.Simulation(model)
        try:
            simulation.restore(dict(found.state))
        except _core.ModelError as error:
            raise CaromError(str(error)) from error
        except (TypeError, KeyError) as error:
            raise Unclear(repr(error)) from error
        simulation.advance(3, 1, True, 1.0)

    return judge


def state(folder: Path, base: Path) -> Judge:
    """The arrays of a state, damaged one by one (what a checksum of a checkpoint would not let through)."""
    model = Scene.from_toml(base / RUN / "scenario.toml").to_model()

    def judge(case: bytes) -> None:
        simulation = _core.Simulation(model)
        simulation.advance(5, 1, True, 1.0)
        arrays: dict[str, Any] = dict(simulation.state())
        head, _, body = case.partition(b"\n")
        with np.load(io.BytesIO(body), allow_pickle=False) as given:
            arrays[json.loads(head)["name"]] = given["value"]
        try:
            simulation.restore(arrays)
        except _core.ModelError as error:
            raise CaromError(str(error)) from error
        simulation.advance(3, 1, True, 1.0)
        simulation.state()

    return judge


def expression(folder: Path, base: Path) -> Judge:
    """A formula: compiled, then evaluated and differentiated."""

    def judge(case: bytes) -> None:
        text = case.decode("utf-8", errors="replace")
        try:
            found = _core.Expression(text)
        except ValueError as error:
            if not str(error) or len(str(error)) > 1000:
                raise Unclear(repr(error)) from error
            raise CaromError(str(error)) from error
        values = dict.fromkeys(found.variables, 0.5)
        try:
            found.evaluate(values)
        except ValueError as error:
            raise CaromError(str(error)) from error

    return judge


def _crash(folder: Path, base: Path) -> Judge:
    """What the harness must notice, on demand."""

    def judge(case: bytes) -> None:
        if case == b"segfault":
            os.kill(os.getpid(), signal.SIGSEGV)
        elif case == b"hang":
            time.sleep(60)
        elif case == b"allocate":
            bytearray(8 << 30)
        elif case == b"raise":
            raise KeyError(case)

    return judge


TARGETS: dict[str, Callable[[Path, Path], Judge]] = {
    "scenario": scenario,
    "problem": problem,
    "result": result,
    "resume": resumed,
    "checkpoint": saved,
    "state": state,
    "expression": expression,
    "_crash": _crash,
}
