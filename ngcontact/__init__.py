"""Contact of elastic bodies: Haslinger and Hlavacek (1981) for NGSolve.

What solves and writes is imported when it is first asked for: with SciPy it would take as long to
load as NGSolve itself.
"""

import importlib as _importlib
import typing as _typing

from .errors import ContactError, ConvergenceError, NoEquilibriumError
from .problem import Contact, Elastic, Hooke, Problem

if _typing.TYPE_CHECKING:
    from .adaptive import adapt
    from .output import write_series
    from .qp import solve_qp
    from .solution import Solution
    from .solving import solve

__version__ = "0.1.0"
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

_MODULES = {
    "Solution": "solution",
    "adapt": "adaptive",
    "solve": "solving",
    "solve_qp": "qp.solving",
    "write_series": "output.vtk",
}


def __getattr__(name: str) -> object:
    """Return a public name of a module that is not loaded yet."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(_importlib.import_module(f".{_MODULES[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return all names, loaded or not."""
    return sorted({*globals(), *__all__})
