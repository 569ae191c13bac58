"""Contact problems as data: read, written, checked, solved and judged without a simulation."""

from carom.problem.contact import ContactProblem
from carom.problem.errors import ContactProblemError, ContactProblemWarning
from carom.problem.fclib import read_fclib, write_fclib
from carom.problem.global_ import GlobalProblem
from carom.problem.local import LocalProblem
from carom.problem.matrix import Csr
from carom.problem.profile import Profile
from carom.problem.rank import Rank, rank_of
from carom.problem.residual import Residual, residual_of
from carom.problem.solve import Solution, SolveFailed, Stage, solvers

__all__ = [
    "ContactProblem",
    "ContactProblemError",
    "ContactProblemWarning",
    "Csr",
    "GlobalProblem",
    "LocalProblem",
    "Profile",
    "Rank",
    "Residual",
    "Solution",
    "SolveFailed",
    "Stage",
    "rank_of",
    "read_fclib",
    "residual_of",
    "solvers",
    "write_fclib",
]
