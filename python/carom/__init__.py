"""Carom: frictional spheres that touch, hit, slide, roll and spin, by nonsmooth contact dynamics.

Nothing heavy is imported here: every name below is fetched at first use, so that `import carom` costs
milliseconds.
"""

from __future__ import annotations

import sys
from importlib import import_module  # noqa: TID251 the lazy names of the package
from importlib.machinery import ModuleSpec
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from types import ModuleType

    __version__: str
    from carom import audit as audit
    from carom import problem as problem
    from carom.errors import CaromError as CaromError
    from carom.errors import CaromWarning as CaromWarning
    from carom.errors import ScenarioError as ScenarioError
    from carom.many.batch import simulate_batch as simulate_batch
    from carom.many.batch_result import Batch as Batch
    from carom.many.compare import Comparison as Comparison
    from carom.many.compare import compare as compare
    from carom.many.converge import Convergence as Convergence
    from carom.many.converge import converge as converge
    from carom.many.fit import Calibration as Calibration
    from carom.many.fit import Fit as Fit
    from carom.many.fit import fit as fit
    from carom.many.sweep import Study as Study
    from carom.many.sweep import Sweep as Sweep
    from carom.many.sweep import sweep as sweep
    from carom.measure import events as events
    from carom.measure import granular as granular
    from carom.problem import ContactProblem as ContactProblem
    from carom.run.result import Result as Result
    from carom.run.result import load as load
    from carom.run.simulate import RunFailed as RunFailed
    from carom.run.simulate import resume as resume
    from carom.run.simulate import simulate as simulate
    from carom.run.stepping import Simulation as Simulation
    from carom.scene import billiards as billiards
    from carom.scene import chains as chains
    from carom.scene import packing as packing
    from carom.scene.examples import example as example
    from carom.scene.scene import Scene as Scene

# The one table of public names: what `from carom import X` finds, and where it lives.
_HOMES = {
    "Batch": "many.batch_result",
    "Calibration": "many.fit",
    "CaromError": "errors",
    "CaromWarning": "errors",
    "Comparison": "many.compare",
    "ContactProblem": "problem",
    "Convergence": "many.converge",
    "Fit": "many.fit",
    "Result": "run.result",
    "RunFailed": "run.simulate",
    "ScenarioError": "errors",
    "Scene": "scene.scene",
    "Simulation": "run.stepping",
    "Study": "many.sweep",
    "Sweep": "many.sweep",
    "compare": "many.compare",
    "converge": "many.converge",
    "example": "scene.examples",
    "fit": "many.fit",
    "load": "run.result",
    "resume": "run.simulate",
    "sensitivity": "many.sensitivity",
    "simulate": "run.simulate",
    "simulate_batch": "many.batch",
    "sweep": "many.sweep",
}

# Modules whose parts are public, `carom.problem.Profile`, `carom.events.AtRest`, and where they live.
_MODULES = {
    "audit": "audit",
    "billiards": "scene.billiards",
    "chains": "scene.chains",
    "events": "measure.events",
    "granular": "measure.granular",
    "packing": "scene.packing",
    "problem": "problem",
}

# Modules, and names of those that are packages now, as they were called before 0.2; they go in 0.3. The longest name counts.
_MOVED = {
    "batch": "many.batch",
    "comparison": "many.compare",
    "convergence": "many.order",
    "demo": "reproduce.demo",
    "film": "show.film",
    "paper": "reproduce",
    "plot": "show.plot",
    "plot.sweep": "many.sweep.plot",
    "record": "result.record",
    "result.Body": "result.kinematics",
    "result.Result": "run.result",
    "result.load": "run.result",
    "run.CaromWarning": "errors",
    "run.RunFailed": "run.simulate",
    "scenario": "scene.tables",
    "scenario.load": "scene.toml.load",
    "scenario.schema": "scene.toml.schema",
    "scene.Scene": "scene.scene",
    "stepping": "run.stepping",
    "study": "many.converge",
    "sweeps": "many.sweep",
    "tables": "result.tables",
    "view": "show.viewer",
    "walls": "result.walls",
    "watching": "run.watch",
}

__all__ = [*sorted(_HOMES), "__version__"]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return _version()
    if name in _MODULES:
        return import_module(f"carom.{_MODULES[name]}")
    home = _HOMES.get(name)
    if home is None:
        # With both keywords a traceback says which name was meant.
        raise AttributeError(
            f"module 'carom' has no attribute '{name}'", name=name, obj=sys.modules[__name__]
        )
    value = getattr(import_module(f"carom.{home}"), name)
    globals()[name] = value
    return value


class _Elsewhere:
    """Finds a module by another name than its own: `carom.events`, and what is in `_MOVED`, with a warning."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        package, _, name = fullname.partition(".")
        if package != "carom":
            return None
        table = _MODULES | _MOVED
        old = name
        while old and old not in table:
            old = old.rpartition(".")[0]
        home = f"carom.{table[old]}{name[len(old) :]}" if old else fullname
        if home == fullname:
            return None
        if old in _MOVED:
            _warn(fullname, home)
        loader: Any = self
        return ModuleSpec(fullname, loader, origin=home)

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        module = import_module(str(spec.origin))
        spec.loader_state = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        spec = module.__spec__
        if spec is None:
            return
        # What it has loaded is known by this name, too: an import would put `table`, the module, in place of the function.
        for name, loaded in list(sys.modules.items()):
            part = name.removeprefix(f"{spec.origin}.")
            if part != name and f"{spec.name}.{part}".removeprefix("carom.") not in _MOVED:
                sys.modules.setdefault(f"{spec.name}.{part}", loaded)
        module.__spec__ = spec.loader_state  # it keeps its own name


# First, since a package by another name would let its modules be loaded a second time.
sys.meta_path.insert(0, _Elsewhere())


def _moved(package: str) -> Callable[[str], Any]:
    """`__getattr__` of a package that was a module before: for the names of it in `_MOVED`."""

    def get(name: str) -> Any:
        home = _MOVED.get(f"{package.removeprefix('carom.')}.{name}")
        if home is None:
            raise AttributeError(f"module '{package}' has no attribute '{name}'", name=name)
        _warn(f"{package}.{name}", f"carom.{home}.{name}")
        return getattr(import_module(f"carom.{home}"), name)

    return get


def _warn(old: str, new: str) -> None:
    import warnings

    told = f"{old} is {new} now; the old name goes in the next minor version"
    warnings.warn(told, DeprecationWarning, stacklevel=3)


def _version() -> str:
    # Stated once, in Cargo.toml, whence the core has it; without a built core only the installer knows.
    try:
        return str(import_module("carom._core").__version__)
    except ImportError:
        from importlib.metadata import PackageNotFoundError, version

        try:
            return version("carom")
        except PackageNotFoundError:
            return "unknown"


def __dir__() -> list[str]:
    return sorted({*__all__, *_MODULES, *(name for name in globals() if name.startswith("__"))})
