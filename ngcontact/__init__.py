"""Contact of elastic bodies: Haslinger and Hlavacek (1981) for NGSolve."""

from .adapt import adapt, solve
from .errors import ContactError, ConvergenceError, NoEquilibriumError
from .material import Elastic, Hooke
from .output import write_series
from .problem import Contact, Problem
from .solution import Solution
from .ssn import solve_qp

__all__ = [
    "Contact",
    "ContactError",
    "ConvergenceError",
    "Elastic",
    "Hooke",
    "NoEquilibriumError",
    "Problem",
    "Solution",
    "adapt",
    "solve",
    "solve_qp",
    "write_series",
]
