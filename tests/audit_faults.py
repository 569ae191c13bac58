"""Planted faults: edits of a copy of a run, each of which a law forbids."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
from carom.audit import Report
from numpy.typing import NDArray

Fault = Callable[[h5py.File], None]
F64 = NDArray[np.float64]


def planted(run: Path, copy: Path, fault: Fault) -> Path:
    """A copy of a run with a fault."""
    shutil.copytree(run, copy)
    with h5py.File(copy / "results.h5", "r+", libver="latest") as file:
        fault(file)
    return copy


def reworded(run: Path, copy: Path, given: str, other: str) -> Path:
    """A copy of a run whose scenario says something else than what was simulated."""
    shutil.copytree(run, copy)
    text = (copy / "scenario.toml").read_text()
    assert given in text
    (copy / "scenario.toml").write_text(text.replace(given, other))
    return copy


def kinds(report: Report) -> set[str]:
    """The kinds of laws that are violated."""
    return {finding.kind for finding in report.findings}


def rows_of(file: h5py.File, frame: int) -> slice:
    """The contacts of a frame."""
    ends = file["frames/contact_end"]
    return slice(int(ends[frame - 1]), int(ends[frame]))


def flip_impulse(frame: int) -> Fault:
    """The impulse of the first contact of a frame pulls."""

    def edit(file: h5py.File) -> None:
        row = rows_of(file, frame).start
        file["contacts/impulse"][row] = -file["contacts/impulse"][row]

    return edit


def _tangential(file: h5py.File, row: int, change: Callable[[F64, F64], F64]) -> None:
    """Replace the sliding part of an impulse and give the body the difference: momentum and spin still balance."""
    impulse, normal = file["contacts/impulse"][row], file["contacts/normal"][row]
    push = (impulse @ normal) * normal
    new = push + change(push, impulse - push)
    file["contacts/impulse"][row] = new
    frame = int(np.searchsorted(file["frames/contact_end"][:], row, side="right"))
    body = int(file["contacts/body"][row, 0])
    mass, inertia, radius = (file[f"bodies/{name}"][body] for name in ("mass", "inertia", "radius"))
    dv, dw = (new - impulse) / mass, -radius * np.cross(normal, new - impulse) / inertia
    h = float(file.attrs["step"])
    later = slice(frame, None)
    steps = file["frames/step"][later] - file["frames/step"][frame]
    file["frames/velocity"][later, body] += dv
    file["frames/angular_velocity"][later, body] += dw
    file["frames/position"][later, body] += h * steps[:, None] * dv


def widen_friction(frame: int) -> Fault:
    """Friction of three times what it was, with the motion that it would give."""
    return lambda file: _tangential(file, rows_of(file, frame).start, lambda push, slide: 3.0 * slide)


def drag_along(frame: int) -> Fault:
    """Friction along the slip, as large as before, with the motion that it would give."""
    return lambda file: _tangential(file, rows_of(file, frame).start, lambda push, slide: -slide)


def lose_impulse(frame: int) -> Fault:
    """An impulse is gone, the motion that it gave is not."""

    def edit(file: h5py.File) -> None:
        file["contacts/impulse"][rows_of(file, frame).start] = 0.0

    return edit


def push_velocity(frame: int, body: int, by: F64) -> Fault:
    """A velocity at one frame is another."""

    def edit(file: h5py.File) -> None:
        file["frames/velocity"][frame, body] += by

    return edit


def speed_up(frame: int, body: int, factor: float) -> Fault:
    """From a frame on a body is faster, energies of the steps with it, as if a push had come from nowhere."""

    def edit(file: h5py.File) -> None:
        velocity = file["frames/velocity"][frame:, body]
        mass = file["bodies/mass"][body]
        gained = 0.5 * mass * (factor**2 - 1.0) * (velocity**2).sum(axis=1)
        file["frames/velocity"][frame:, body] = factor * velocity
        h = float(file.attrs["step"])
        extra = np.cumsum((factor - 1.0) * h * velocity, axis=0) - (factor - 1.0) * h * velocity
        file["frames/position"][frame:, body] += extra
        steps = file["frames/step"][frame:].astype(np.int64) - 1
        file["steps/energy_kinetic"][int(steps[0]) : int(steps[-1]) + 1] += gained

    return edit


def raise_energy(step: int, by: float) -> Fault:
    """The recorded kinetic energy from a step on is more than that of the motion."""

    def edit(file: h5py.File) -> None:
        file["steps/energy_kinetic"][step:] += by

    return edit


def shift_frame(frame: int) -> Fault:
    """One frame is that of the step before, with its own time."""

    def edit(file: h5py.File) -> None:
        for name in ("position", "orientation", "velocity", "angular_velocity"):
            file[f"frames/{name}"][frame] = file[f"frames/{name}"][frame - 1]

    return edit


def scale_quaternion(frame: int, body: int) -> Fault:
    """A quaternion is a little too long."""

    def edit(file: h5py.File) -> None:
        file["frames/orientation"][frame, body] *= 1.0 + 1e-9

    return edit


def turn_body(frame: int, body: int, angle: float) -> Fault:
    """An orientation is turned about z by an angle."""

    def edit(file: h5py.File) -> None:
        w, x, y, z = file["frames/orientation"][frame, body]
        c, s = np.cos(0.5 * angle), np.sin(0.5 * angle)
        file["frames/orientation"][frame, body] = [c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w]

    return edit


def not_a_number(path: str, row: int) -> Fault:
    """A number is none."""

    def edit(file: h5py.File) -> None:
        file[path][row] = np.nan

    return edit


def move_body(frame: int, body: int, by: F64) -> Fault:
    """From a frame on a body is elsewhere."""

    def edit(file: h5py.File) -> None:
        file["frames/position"][frame:, body] += by

    return edit


def _given_otherwise(row: int, change: Callable[[F64, F64], F64]) -> Fault:
    """The impulse of an impact and of its contact has a `change` of its parts more, with the motion that this gives."""

    def edit(file: h5py.File) -> None:
        a, b = (int(i) for i in file["impacts/body"][row])
        step = int(file["impacts/step"][row])
        frame = int(np.searchsorted(file["frames/step"][:], step))
        normal, impulse = file["impacts/normal"][row], file["impacts/impulse"][row]
        push = (impulse @ normal) * normal
        extra = change(push, impulse - push)
        rows = rows_of(file, frame)
        own = rows.start + int(np.flatnonzero((file["contacts/body"][rows] == (a, b)).all(axis=1))[0])
        file["impacts/impulse"][row] = impulse + extra
        file["contacts/impulse"][own] += extra
        gained = 0.0
        h, n = float(file.attrs["step"]), len(file["bodies/mass"])
        steps = (file["frames/step"][frame:] - step).astype(float)
        for body, sign in ((a, 1.0), (b, -1.0)):
            if body < n:
                mass, inertia, radius = (
                    file[f"bodies/{name}"][body] for name in ("mass", "inertia", "radius")
                )
                dv = sign * extra / mass
                file["frames/velocity"][frame:, body] += dv
                file["frames/position"][frame:, body] += h * steps[:, None] * dv
                file["frames/angular_velocity"][frame:, body] -= radius * np.cross(normal, extra) / inertia
                gained += dv @ normal * sign
        file["impacts/separation"][row] += gained

    return edit


def restitute(row: int, factor: float) -> Fault:
    """The push of an impact is so many times as large, with the motion that it would give."""
    return _given_otherwise(row, lambda push, slide: (factor - 1.0) * push)


def restore_slip(row: int, factor: float) -> Fault:
    """Its friction is."""
    return _given_otherwise(row, lambda push, slide: (factor - 1.0) * slide)


def open_contact(frame: int, by: float) -> Fault:
    """Bodies of a contact that pushes are apart: A stands off along the normal in all frames, as the recorded gaps do."""

    def edit(file: h5py.File) -> None:
        rows = rows_of(file, frame)
        body, normal = int(file["contacts/body"][rows.start, 0]), file["contacts/normal"][rows.start]
        file["frames/position"][:, body] += by * normal
        mine = file["contacts/body"][:, 0] == body
        file["contacts/gap"][:] = np.where(mine, file["contacts/gap"][:] + by, file["contacts/gap"][:])

    return edit


def tamper_time(frame: int, by: float) -> Fault:
    """A time is another."""

    def edit(file: h5py.File) -> None:
        file["frames/time"][frame] += by

    return edit


def roll_against(frame: int) -> Fault:
    """A rolling moment drives instead of braking."""

    def edit(file: h5py.File) -> None:
        row = rows_of(file, frame).start
        file["contacts/moment"][row] = -file["contacts/moment"][row]

    return edit


def heavier(body: int) -> Fault:
    """A mass is one per cent larger than that of the scenario."""

    def edit(file: h5py.File) -> None:
        file["bodies/mass"][body] *= 1.01

    return edit


def report_gap(frame: int, by: float) -> Fault:
    """A recorded gap is none of the positions."""

    def edit(file: h5py.File) -> None:
        file["contacts/gap"][rows_of(file, frame).start] += by

    return edit


def lighter_wall(wall: int) -> Fault:
    """A wall is said to have got half of its largest impulse."""

    def edit(file: h5py.File) -> None:
        impulse = file["frames/walls"][:, wall, :3]
        frame = int(np.argmax((impulse**2).sum(axis=1)))
        file["frames/walls"][frame, wall, :3] = 0.5 * impulse[frame]

    return edit


def more_work(frame: int, by: float) -> Fault:
    """Contacts of a frame are said to have given energy."""

    def edit(file: h5py.File) -> None:
        file["contacts/work_normal"][rows_of(file, frame).start] += by

    return edit


def write(path: str, row: object, value: object) -> Fault:
    """A number, or a row of them, is another."""

    def edit(file: h5py.File) -> None:
        values = file[path][...]
        values[row] = value
        file[path][...] = values

    return edit


def lose_impact(row: int) -> Fault:
    """An impact is told of another pair that did not meet: its own has none."""

    def edit(file: h5py.File) -> None:
        pairs = {tuple(pair) for pair in file["contacts/body"][:].tolist()}
        n = len(file["bodies/mass"])
        free = next((a, b) for a in range(n) for b in range(a + 1, n) if (a, b) not in pairs)
        file["impacts/body"][row] = free

    return edit


def of_pile(fault: Callable[[int], Fault], problem: int) -> Fault:
    """A fault in the strongest row of a problem, in a step of one group of contacts alone, a pile, that was not cut and
    whose restitution is whole.
    """

    def edit(file: h5py.File) -> None:
        steps, table = file["steps"], file["impacts"]
        alone = (steps["islands"][:] == 1) & (steps["largest_island"][:] > 10) & (steps["truncated"][:] == 0)
        alone &= steps["restitution_scale"][:] == 1.0
        mine = alone[table["step"][:].astype(np.int64) - 1] & (table["problem"][:] == problem)
        strength = np.where(mine, (table["impulse"][:] ** 2).sum(axis=1), -1.0)
        assert strength.max() > 0.0
        fault(int(np.argmax(strength)))(file)

    return edit


def of_collective(fault: Callable[[int], Fault]) -> Fault:
    """A fault in the strongest row of the problems that end sequences which were cut."""

    def edit(file: h5py.File) -> None:
        problem, impulse = file["impacts/problem"][:], file["impacts/impulse"][:]
        cut = file["steps/truncated"][:][file["impacts/step"][:].astype(np.int64) - 1] > 0
        last = problem == problem[cut].max()
        fault(int(np.argmax(np.where(cut & last, (impulse**2).sum(axis=1), -1.0))))(file)

    return edit


def more_friction(row: int, factor: float) -> Fault:
    """Friction of an impact and of its contact is so much larger."""

    def edit(file: h5py.File) -> None:
        normal, impulse = file["impacts/normal"][row], file["impacts/impulse"][row]
        slide = impulse - (impulse @ normal) * normal
        file["impacts/impulse"][row] = impulse + (factor - 1.0) * slide

    return edit


def beyond_cone(row: int) -> Fault:
    """Friction of an impact, which may have stuck, is as large as its normal impulse."""

    def edit(file: h5py.File) -> None:
        normal, impulse = file["impacts/normal"][row], file["impacts/impulse"][row]
        slide = impulse - (impulse @ normal) * normal
        more = (impulse @ normal) / np.linalg.norm(slide) - 1.0
        assert more > 0.0
        file["impacts/impulse"][row] = impulse + more * slide

    return edit


def bring_forward(row: int) -> Fault:
    """Half of the impulse of an impact is told of an earlier problem of its pair: all sums remain."""

    def edit(file: h5py.File) -> None:
        step, body = file["impacts/step"][:], file["impacts/body"][:]
        pair = np.flatnonzero((step == step[row]) & (body == body[row]).all(axis=1))
        other = int(pair[pair != row][0])
        half = 0.5 * file["impacts/impulse"][row]
        file["impacts/impulse"][row] = half
        file["impacts/impulse"][other] = file["impacts/impulse"][other] + half

    return edit


def scale(path: str, row: int, factor: float) -> Fault:
    """A number, or a row of them, is so many times as large."""

    def edit(file: h5py.File) -> None:
        file[path][row] = factor * file[path][row]

    return edit


def scale_largest(column: str, factor: float) -> Fault:
    """The largest number of a column is another."""

    def edit(file: h5py.File) -> None:
        file[column][int(np.argmax(np.abs(file[column][...])))] *= factor

    return edit


def at_entry(column: str, by: float) -> Fault:
    """A ball is elsewhere, or of another speed, in the frame of the step in which it entered."""

    def edit(file: h5py.File) -> None:
        event = int(np.flatnonzero((file["events/kind"][:] == 1) & (file["events/step"][:] > 0))[0])
        frame = int(np.searchsorted(file["frames/step"][:], file["events/step"][event]))
        file[f"frames/{column}"][frame, int(file["events/body"][event])] += by

    return edit


def fall_on(by: float) -> Fault:
    """The ball that leaves first is so much lower in the frame before, and there already."""

    def edit(file: h5py.File) -> None:
        event = int(np.flatnonzero(file["events/kind"][:] == 0)[0])
        frame = int(np.searchsorted(file["frames/step"][:], file["events/step"][event])) - 1
        file["frames/position"][frame, int(file["events/body"][event]), 2] -= by

    return edit


def slip_in_place_of_stick(file: h5py.File) -> None:
    """The last contact that sticks is said to slip."""
    status = file["contacts/status"]
    status[int(np.flatnonzero(status[:] == 1)[-1])] = 2
