"""What a run left behind, in memory or read from its directory as far as it is asked for. `carom.Result` is this, with what
is made of a run (`carom.run.result`).

Arrays are `Column`s: they know their shape, read what is indexed, and act as NumPy arrays. Tables have one
column per quantity: `result.impacts["time"]` or `result.impacts.time`. Units are SI throughout.
"""

from __future__ import annotations

import copy
import shutil
import warnings
import weakref
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np

from carom.arrays import F64
from carom.errors import CaromError, counted
from carom.files import lies_in
from carom.result.boxes import Boxes
from carom.result.clumps import Clumps
from carom.result.directory import RunDir, temporary
from carom.result.kinematics import Frames, Part
from carom.result.names import Names
from carom.result.outcome import Outcome
from carom.result.record import Column, Memory, Record, Writer
from carom.result.run_json import checked, opened
from carom.result.selection import Selection
from carom.result.tables import (
    Contacts,
    Energy,
    Events,
    Impacts,
    Impulses,
    Residuals,
    Static,
    Steps,
    Transitions,
)
from carom.result.walls import Walls, meshes
from carom.scene.assembly.arrays import identify
from carom.scene.packing.periodic import PeriodicBox
from carom.scene.scene import Scene


class UnfinishedRun(UserWarning):
    """The run did not reach its end, or has not yet; what is readable is whole."""


class RunData(Frames[Column]):
    """A run: its scene, T frames of N bodies, its impacts, contacts and steps.

    What was committed when the object was made is what it shows; load again to see more of a run in progress.
    """

    def __init__(
        self,
        about: dict[str, Any],
        record: Record,
        directory: RunDir | None = None,
        scene: Scene | None = None,
        problem: Mapping[str, Any] | None = None,
    ) -> None:
        self._about, self._segments, self._directory = about, record, directory
        self._problem = problem  # of a result in memory: the one that could not be solved
        if scene is not None:
            self._ran = scene

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """The result of a run directory, also of one that is still being written or was killed."""
        directory = RunDir.open(path, "load")
        about = checked(directory)
        result = cls(about, opened(directory, about), directory)
        if result.status == "running":
            why = "is still being written" if result.is_being_written else "did not finish"
            cure = "" if result.is_being_written else f" (`carom resume {result.path}` continues it)"
            warnings.warn(f"run {why}; {len(result.time)} frames readable{cure}", UnfinishedRun, stacklevel=3)
        return result

    @property
    def path(self) -> Path:
        """The run directory. A result in memory is written to a temporary one when this is first asked; it goes with it."""
        return (self._directory or self._copy).path

    @property
    def origin(self) -> str:
        """The run directory, or "memory"."""
        return "memory" if self._directory is None else str(self._directory.path)

    @property
    def label(self) -> str:
        """The title, or where there is none the name of the run directory."""
        return self.title or Path(self.origin).name

    @property
    def segment_names(self) -> list[str]:
        """The results files, in the order of the run."""
        return [] if self._directory is None else [file.name for file in self._directory.segments()]

    # Motion, one row per frame.

    @property
    def time(self) -> Column:
        """Times of the frames, (T,), s."""
        return self._segments.column("frames", "time")

    @property
    def step(self) -> Column:
        """Steps after which the frames were taken, (T,); 0 is the start."""
        return self._segments.column("frames", "step")

    @property
    def joint_impulse(self) -> Column:
        """Impulse at each joint on its first body since the last frame, and couple there, (T, J, 6), N s and N m s, in the
        world frame; over the time between frames it is the mean reaction. The moment `r x J` of the impulse about the
        centre is not in it. Without joints the shape is (T, 0, 6).
        """
        if "joint_impulse" not in self._segments.columns("frames"):
            frames = len(self.time)
            return Column([(np.zeros((frames, 0, 6)), frames)], "N s, N m s")
        return self._segments.column("frames", "joint_impulse")

    def _quantity(self, name: str) -> Column:
        if name == "present" and name not in self._segments.columns("frames"):
            shape = (len(self.time), len(self.names))
            return Column([(np.broadcast_to(np.ones(1, dtype=bool), shape), shape[0])], "1")
        return self._segments.column("frames", name)

    # What the run is about.

    @cached_property
    def bodies(self) -> Static:
        """One row per body: name, radius (m), mass (kg), inertia (kg m^2), material."""
        return Static(self._segments.static("bodies"))

    @cached_property
    def planes(self) -> Static:
        """One row per plane without end: name, point (m), normal, material."""
        return Static(self._segments.static("planes"))

    @cached_property
    def walls(self) -> Walls:
        """All walls by name: `result.walls["drum"].torque`, also `force`, `impulse`, `position`, `orientation`."""
        rows = [self._segments.static(table) for table in ("planes", "walls")]
        shapes = ["plane"] * len(rows[0]["name"]) + [str(shape) for shape in rows[1].get("shape", ())]
        try:
            static = self._segments.static
            made = meshes(static("mesh_points"), static("mesh_triangles"), shapes)
        except (IndexError, KeyError, ValueError) as error:
            raise self._segments.damage("/mesh_triangles", str(error)) from error
        return Walls(self, rows, made)

    @cached_property
    def clumps(self) -> Clumps:
        """All clumps by name: `result.clumps["rod"].position`, also `orientation`, `velocity`, `kinetic_energy`."""
        return Clumps(self, self._segments.static("clumps"))

    @property
    def plane_names(self) -> list[str]:
        """Names of the planes without end."""
        return list(self.planes["name"])

    @property
    def wall_names(self) -> list[str]:
        """Names of all walls, planes without end first."""
        return list(self.walls)

    @property
    def joint_names(self) -> list[str]:
        """Names of the joints, in the order of the second axis of `joint_impulse`; by default joint1, joint2 ..."""
        return self.scene.joint_names

    @property
    def gravity(self) -> F64:
        """Acceleration of gravity, (3,), m/s^2."""
        return np.asarray(self._segments.attributes["gravity"], dtype=np.float64)

    @property
    def periodic(self) -> F64 | None:
        """Periods of the world along x, y, z, m, 0 where it has none; None if it has none at all. Of a box that deforms
        those at the start; `box(frame)` has those of a frame.
        """
        found = self._segments.attributes.get("periodic")
        return None if found is None else np.asarray(found, dtype=np.float64)

    @property
    def periodic_origin(self) -> F64:
        """Lowest corner of the periodic box, (3,), m; of one that deforms at the start."""
        return np.asarray(self._segments.attributes.get("periodic_origin", np.zeros(3)), dtype=np.float64)

    @cached_property
    def boxes(self) -> Boxes | None:
        """The periodic boxes of all frames, which differ where the box deforms; None of a world without."""
        return Boxes.of(self)

    def box(self, frame: int = -1) -> PeriodicBox | None:
        """The periodic box at a frame: `lengths`, `vectors`, `fold`, `nearest`, `flow_velocity`; None of a world without."""
        return None if self.boxes is None else self.boxes[frame]

    @property
    def title(self) -> str:
        """Title of the scenario."""
        return str(self._about.get("scenario", {}).get("title") or "")

    @property
    def case(self) -> str | None:
        """Name of the case of the scenario file that was run, if it was one."""
        found = self._about.get("scenario", {}).get("case")
        return None if found is None else str(found)

    @property
    def parameters(self) -> dict[str, float]:
        """Values of the parameters of the scenario file, SI, and of those of `study` that it has not."""
        return dict(self._about.get("scenario", {}).get("parameters", {}))

    @property
    def study(self) -> dict[str, float]:
        """Values of the parameters of the study whose case was run: a name may be one of the file's as well."""
        return dict(self._about.get("scenario", {}).get("study", {}))

    @cached_property
    def scene(self) -> Scene:
        """The scene as it was run: every default spelled out, random numbers drawn. What is done to it changes no run."""
        if self._directory is None:
            return copy.copy(self._ran)
        return Scene.from_toml(self._directory.scenario)

    @property
    def scenario(self) -> str:
        """The scenario as it was run, as TOML."""
        if self._directory is None:
            return self._ran.to_toml(resolved=True)
        path = self._directory.scenario
        try:
            return path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise CaromError(f"{path} cannot be read ({error}); a run keeps its scenario there") from error

    def __len__(self) -> int:
        return len(self.time)

    def _parts(self) -> list[Part]:
        return [Part.of(clump, self._mass()) for clump in self.clumps.values()]

    @cached_property
    def _called(self) -> Names:
        """What the numbers of bodies in tables are called."""
        clumps = {name: clump.numbers for name, clump in self.clumps.items()}
        return Names([*self.names, *self.wall_names], clumps)

    # What happened.

    @cached_property
    def energy(self) -> Energy:
        """Energies after every step, (S,), J."""
        return Energy(self.steps)

    @cached_property
    def impacts(self) -> Impacts:
        """One row per contact and impact problem: time, step, problem, pair, impulse, status ..."""
        return Impacts(self._segments, self._called)

    @cached_property
    def impulses(self) -> Impulses:
        """How the impulses of each impact grow; none unless the run has `impacts = "history"`."""
        return Impulses(self._segments, self._called)

    @cached_property
    def events(self) -> Events:
        """One row per ball that entered or left; none without inflows and outlets."""
        return Events(self._segments, self.names)

    @cached_property
    def transitions(self) -> Transitions:
        """One row per ball whose motion changed at an event of method `events`; none with other methods."""
        return Transitions(self._segments, self._called)

    @property
    def flows(self) -> bool:
        """Whether the scene has inflows or outlets."""
        return bool(self._segments.columns("events"))

    @cached_property
    def contacts(self) -> Contacts:
        """One row per frame and contact: impulses of both levels and work by cause since the last frame."""
        return Contacts(self._segments, self._called)

    @cached_property
    def steps(self) -> Steps:
        """One row per step: iterations, residuals, counts, energies, penetration."""
        return Steps(self._segments)

    @cached_property
    def residuals(self) -> Residuals:
        """One row per recorded contact problem: the residual after each iteration."""
        return Residuals(self._segments)

    @property
    def status(self) -> str:
        """ "done", "stopped", "failed", "interrupted", or "running" (also for a run whose process was killed)."""
        return str(self._about["status"])

    @property
    def _has_bare_end(self) -> bool:
        """Whether the last frame is the state alone, without contacts and impulses since the frame before: off the grid, of
        a run that did not reach its end, and of `Simulation.result`.
        """
        whole = self.status == "done" and not self._about.get("bare_end")
        return not whole and bool(self.step[-1] % int(self._segments.attributes["every"]))

    @property
    def is_being_written(self) -> bool:
        """Whether the process that computes the run is alive, on this machine."""
        return self._directory is not None and self._directory.is_being_written()

    @property
    def outcome(self) -> Outcome:
        """How the run ended, with advice if it did not end well; `outcome.ok` is true if it reached its end."""
        return Outcome.of(self._about.get("outcome") or {"kind": self.status})

    @property
    def summary(self) -> Mapping[str, Any]:
        """What `carom run --json` prints; empty while the run goes on."""
        found: Mapping[str, Any] = self._about.get("summary", {})
        return found

    @property
    def versions(self) -> Mapping[str, Any]:
        """Versions of all that computed the run."""
        found: Mapping[str, Any] = self._about.get("versions", {})
        return found

    # What can be done with it.

    def sel(self, time: Any = None, body: Any = None) -> Selection:
        """Some frames and some balls, with the same names for what they have. A part has no figures, pages and files.

        `time` is a slice in s, of which both ends count (`slice(0.1, 0.5)`, every tenth frame of them
        `slice(0.1, 0.5, 10)`), or one or several times, of which the nearest frames are taken. `body` is a name or a
        number, several of them, or a slice (`slice("ball1", "ball4")`, of names both ends count, of numbers the last does
        not): `result.sel(slice(0, 1), ["cue", "ball8"]).velocity`. The name of a clump means its balls. Masks, with a truth
        for each frame or body, choose as well, and times may have units: `"20 ms"`.
        """
        return Selection.of(self, time, body)

    def save(self, path: str | Path, *, force: bool = False) -> Self:
        """Write a result that was simulated without `out` to a run directory, or copy its own; returns the copy."""
        if self._directory is not None and lies_in(Path(path), self.path):
            raise CaromError(f"{path} is the directory of this run, or lies in it; choose another directory")
        to = RunDir.create(path, force=force)
        with to.writing():
            try:
                if self._directory is None:
                    self._write(to)
                else:
                    shutil.copytree(self.path, to.path, dirs_exist_ok=True)
            except (OSError, CaromError) as error:
                to.remove()
                raise CaromError(f"cannot copy the run to {path}: {error}") from error
        return type(self).load(to.path)

    @cached_property
    def _copy(self) -> RunDir:
        """The temporary directory of a result in memory."""
        directory = temporary()
        weakref.finalize(self, directory.remove)
        with directory.writing():
            self._write(directory)
        return directory

    def _write(self, directory: RunDir) -> None:
        """Write a result in memory to a new directory, whose writer this is."""
        assert isinstance(self._segments, Memory)
        about = copy.deepcopy(self._about)
        about["scenario"]["identity"] = identify(self._ran.to_model())
        directory.write_scenario(self.scenario)
        writer = Writer(
            directory.next_segment(),
            **self._segments.described,
            expected=self._segments.rows,
            further=directory.next_segment,
        )
        writer.append(self._segments.blocks())
        writer.close()
        about["segments"][-1]["file"] = writer.paths[0].name
        if len(writer.paths) > 1:
            about["segments"][-1]["files"] = [file.name for file in writer.paths]
        self._write_problem(directory, about["outcome"])
        directory.write(about)
        directory.log("saved", status=self.status)

    def _write_problem(self, directory: RunDir, outcome: dict[str, Any]) -> None:
        """Write the problem that could not be solved, and say in the outcome where."""

    def close(self) -> None:
        """Close the files. Columns that were read stay usable."""
        self._segments.close()

    def __reduce__(self) -> Any:
        """Copies and other processes open the run anew; files that are open cannot be sent."""
        if self._directory is None:
            return type(self), (self._about, self._segments, None, self._ran, self._problem)
        return type(self).load, (self._directory.whole,)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        frames, bodies = len(self.time), self.names
        shown = ", ".join(bodies[:4]) + (f", ... ({len(bodies)})" if len(bodies) > 4 else "")
        span = f"t = {self.time[0]:g} to {self.time[-1]:g} s" if frames else "no frames yet"
        lines = [
            f"<carom.Result {self.label!r}: {self.outcome.brief}>",
            f"  {counted(frames, 'frame')}, {span}; {counted(len(self.steps), 'step')}",
            f"  bodies    {shown}",
            f"  impacts   {len(self.impacts)} rows; contacts {len(self.contacts)} rows",
            "  kept in memory; save(path) writes it"
            if self._directory is None
            else f"  directory {self.path}",
        ]
        return "\n".join(lines)
