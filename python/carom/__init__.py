"""Carom: frictional spheres that touch, hit, slide, roll and spin, by nonsmooth contact dynamics.

Nothing heavy is imported here: every name below is fetched at first use, so that `import carom` costs
milliseconds.
"""

from __future__ import annotations

import sys
from importlib import import_module  # noqa: TID251 the lazy names of the package
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    __version__: str
    from carom.batch import Batch as Batch
    from carom.batch import simulate_batch as simulate_batch
    from carom.comparison import Comparison as Comparison
    from carom.comparison import compare as compare
    from carom.errors import CaromError as CaromError
    from carom.errors import ScenarioError as ScenarioError
    from carom.examples import example as example
    from carom.problem import ContactProblem as ContactProblem
    from carom.result import Result as Result
    from carom.result import load as load
    from carom.run import RunFailed as RunFailed
    from carom.run import resume as resume
    from carom.run import simulate as simulate
    from carom.scene import Scene as Scene
    from carom.stepping import Simulation as Simulation
    from carom.study import Convergence as Convergence
    from carom.study import converge as converge
    from carom.sweeps import Study as Study
    from carom.sweeps import Sweep as Sweep
    from carom.sweeps import sweep as sweep

# The one table of public names: what `from carom import X` finds, and where it lives.
_HOMES = {
    "Batch": "carom.batch",
    "simulate_batch": "carom.batch",
    "CaromError": "carom.errors",
    "Comparison": "carom.comparison",
    "compare": "carom.comparison",
    "Convergence": "carom.study",
    "ContactProblem": "carom.problem",
    "converge": "carom.study",
    "ScenarioError": "carom.errors",
    "example": "carom.examples",
    "Result": "carom.result",
    "load": "carom.result",
    "Scene": "carom.scene",
    "RunFailed": "carom.run",
    "Simulation": "carom.stepping",
    "Study": "carom.sweeps",
    "Sweep": "carom.sweeps",
    "sweep": "carom.sweeps",
    "resume": "carom.run",
    "simulate": "carom.run",
}

_MODULES = ("audit", "billiards", "events", "granular", "packing", "problem")

__all__ = [
    "Batch",
    "CaromError",
    "Comparison",
    "ContactProblem",
    "Convergence",
    "Result",
    "RunFailed",
    "ScenarioError",
    "Scene",
    "Simulation",
    "Study",
    "Sweep",
    "__version__",
    "compare",
    "converge",
    "example",
    "load",
    "resume",
    "simulate",
    "simulate_batch",
    "sweep",
]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return _version()
    if name in _MODULES:  # whose parts are public: `carom.problem.Profile`, `carom.events.AtRest`
        return import_module(f"carom.{name}")
    home = _HOMES.get(name)
    if home is None:
        # With both keywords a traceback says which name was meant.
        raise AttributeError(
            f"module 'carom' has no attribute '{name}'", name=name, obj=sys.modules[__name__]
        )
    value = getattr(import_module(home), name)
    globals()[name] = value
    return value


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
