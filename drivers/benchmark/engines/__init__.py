"""Codes that solve the common problems, for comparison with ngcontact.

Every engine is a module with a function ``runs(problem, kinds, sizes)`` that yields one `Run` per
order, kind of mesh and size. Engines whose package is missing raise `NotInstalledError` there;
their modules can always be imported. NGSolve's threads are the caller's: ``with TaskManager():``.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from types import ModuleType


class NotInstalledError(RuntimeError):
    """A package of an engine is missing; the message names both."""


@dataclass(frozen=True)
class Run:
    """One engine's solution of one problem on one mesh.

    Attributes
    ----------
    engine, problem : str
        Names of the code and of the problem.
    mesh_kind : str
        "uniform", or "graded" around a contact zone known beforehand.
    order : int
        Polynomial degree of the displacement.
    unknowns : int
        Displacement components of all nodes of the bodies, supports included.
    seconds_mesh : float
        Mesh generation; 0 for graded meshes, which are made by hand.
    seconds : float
        Assembly and solution, without reading off results.
    steps : int
        Linear systems solved.
    force, peak, half_width, energy : float
        As in `problems.Reference`.
    """

    engine: str
    problem: str
    mesh_kind: str
    order: int
    unknowns: int
    seconds_mesh: float
    seconds: float
    steps: int
    force: float
    peak: float
    half_width: float
    energy: float


def needed(engine: str, *packages: str) -> list[ModuleType]:
    """Modules `packages` of an optional engine.

    Raises
    ------
    NotInstalledError
        One of them is missing.
    """
    try:
        return [importlib.import_module(name) for name in packages]
    except ImportError as error:
        raise NotInstalledError(
            f"{engine} needs {error.name}, which is not installed: pip install '.[bench]'"
        ) from error
