"""Codes that solve the common problems, for comparison with ngcontact.

Every code is an `Engine`. The modules can be imported without the optional packages, which are
looked for when an engine runs. NGSolve's threads are the caller's: ``with TaskManager():``.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import product
from typing import Any, NamedTuple

from drivers.benchmark.scenes.meshes import made
from drivers.benchmark.scenes.plane import Reading
from drivers.benchmark.scenes.problems import Common


class NotInstalledError(RuntimeError):
    """A package of an engine is missing; the message names both."""


@dataclass(frozen=True)
class Run:
    """One solution of one problem on one mesh; the last four as in `problems.Reference`."""

    engine: str
    problem: str
    mesh_kind: str  # "uniform", or "graded" around a contact zone known beforehand
    order: int
    unknowns: int  # displacement components of all nodes of the bodies, supports included
    seconds_mesh: float  # 0 for graded meshes, which are made by hand
    seconds: float  # assembly and solution, without reading off results
    steps: int  # linear systems solved
    force: float
    peak: float
    half_width: float
    energy: float


class Solved(NamedTuple):
    """What an engine measures and reads off itself, see `Run`."""

    seconds: float
    steps: int
    energy: float
    reading: Reading


def needed(engine: str, *packages: str) -> list[Any]:
    """Modules `packages` of an optional engine; raises NotInstalledError if one is missing."""
    try:
        return [importlib.import_module(name) for name in packages]
    except ImportError as error:
        raise NotInstalledError(
            f"{engine} needs {error.name}, which is not installed: pip install '.[bench]'"
        ) from error


@dataclass(frozen=True)
class Engine:
    """A code with its settings.

    `solve` takes the modules of `packages`, the problem, a mesh and its order, and a penalty where
    several `penalties` are tried, which are part of the engine's name then.
    """

    name: str
    solve: Callable[..., Solved]
    packages: tuple[str, ...] = ()
    orders: tuple[int, ...] = (1, 2)
    penalties: tuple[float, ...] = ()
    meshed_obstacle: bool = False  # a rigid foundation is a mesh that is held
    largest: int = 10**9  # unknowns; more would take minutes a run

    def runs(self, common: Common, kinds: Sequence[str], sizes: Sequence[int]) -> Iterator[Run]:
        """Runs on meshes of the given kinds and numbers of unknowns."""
        modules = needed(self.name, *self.packages)
        rigid = common.problem.contact[0].primary is None
        for kind, order, size in product(kinds, self.orders, sizes):
            mesh = made(common, kind, order, size, self.meshed_obstacle and rigid)
            for penalty in self.penalties or (None,):
                mesh.read()
                given = () if penalty is None else (penalty,)
                seconds, steps, energy, reading = self.solve(modules, common, mesh, order, *given)
                yield Run(
                    engine=" ".join([self.name, *(f"{value:g} E/h" for value in given)]),
                    problem=common.name,
                    mesh_kind=kind,
                    order=order,
                    unknowns=mesh.unknowns(order),
                    seconds_mesh=mesh.seconds,
                    seconds=seconds,
                    steps=steps,
                    energy=energy,
                    **asdict(reading),
                )
