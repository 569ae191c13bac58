"""The oracle: Algorithm 1 in plain NumPy, for at most ten spheres, to be read beside the paper.

It shares no code with the compiled core and solves the full saddle system where the core factors the reduced
one, so that agreement between the two says something. `docs/theory/algorithm.md` is the specification of
both.
"""

from .conditions import Conditions, StepJudgement, conditions, judge_step, position_conditions, split_impulse
from .contact import Impulse
from .model import Model, State
from .newton import NotConverged
from .simulate import Reference
from .step import StepReport

__all__ = [
    "Conditions",
    "Impulse",
    "Model",
    "NotConverged",
    "Reference",
    "State",
    "StepJudgement",
    "StepReport",
    "conditions",
    "judge_step",
    "position_conditions",
    "split_impulse",
]
