"""Kratos: augmented Lagrangian mortar contact without friction, linear triangles.

Four load steps: in a single one it may report success with no contact at all. The plane body under
a rigid foundation's boundary is a mesh whose nodes are held.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.benchmark.engines import Run, needed
from drivers.benchmark.engines.kratos_settings import (
    CONTACT,
    KRATOS,
    MOST,
    STRUCTURAL,
    settings,
    sides,
)
from drivers.benchmark.scenes.meshes import OBSTACLE, Mesh, made
from drivers.benchmark.scenes.plane import Numbering, facing, moduli, prescribed, pressures
from drivers.benchmark.scenes.problems import Common
from drivers.benchmark.scenes.reading import Reading, read
from drivers.benchmark.scenes.triangles import forces

Array = NDArray[np.float64]

ENGINE = "Kratos mortar"
FAILED = Reading(math.nan, math.nan, math.nan)
ROUND_OFF = 1e-6  # of nodal forces relative to the largest; the iteration stops before round-off


def runs(common: Common, kinds: Sequence[str], sizes: Sequence[int]) -> Iterator[Run]:
    """Runs of order 1 on meshes of the given kinds and numbers of unknowns.

    Raises
    ------
    NotInstalledError
        A package of Kratos is missing.
    """
    core, structural, _, analysis, *_ = needed(
        ENGINE,
        KRATOS,
        STRUCTURAL,
        CONTACT,
        f"{STRUCTURAL}.structural_mechanics_analysis",
        f"{KRATOS}.LinearSolversApplication",
    )
    core.Logger.GetDefaultOutput().SetSeverity(core.Logger.Severity.WARNING)
    obstacle = common.problem.contact[0].primary is None
    for kind in kinds:
        for size in sizes:
            mesh = made(common, kind, 1, size, obstacle)
            yield run((core, structural, analysis), common, kind, mesh)


def fill(core: ModuleType, structural: ModuleType, part: Any, common: Common, made: Mesh) -> None:
    """Nodes, triangles, boundaries and the material of `made` in Kratos' model part."""
    [law] = common.problem.materials.values()
    properties = part.CreateNewProperties(1)
    properties.SetValue(core.YOUNG_MODULUS, law.E)  # type: ignore[union-attr]
    properties.SetValue(core.POISSON_RATIO, law.nu)  # type: ignore[union-attr]
    properties.SetValue(core.THICKNESS, 1.0)
    properties.SetValue(core.CONSTITUTIVE_LAW, structural.LinearElasticPlaneStrain2DLaw())
    for number, (x, y) in enumerate(made.points.tolist(), start=1):
        part.CreateNewNode(number, x, y, 0.0)
    for number, corners in enumerate((made.triangles + 1).tolist(), start=1):
        part.CreateNewElement("SmallDisplacementElement2D3N", number, corners, properties)
    count = 0
    for name, ends in made.edges.items():
        boundary = part.CreateSubModelPart(name)
        boundary.AddNodes((np.unique(ends) + 1).tolist())
        if name not in pressures(common) and name not in sides(common):
            continue
        kind = "LineLoadCondition2D2N" if name in pressures(common) else "LineCondition2D2N"
        first = count + 1
        for pair in (ends + 1).tolist():
            count += 1
            part.CreateNewCondition(kind, count, pair, properties)
        boundary.AddConditions(list(range(first, count + 1)))
    if OBSTACLE in made.bodies:
        nodes = np.unique(made.triangles[made.bodies[OBSTACLE]]) + 1
        part.CreateSubModelPart(OBSTACLE).AddNodes(nodes.tolist())


def run(modules: Sequence[ModuleType], common: Common, kind: str, made: Mesh) -> Run:
    """One run on vertices and triangles of the common mesh; NaN where Kratos fails."""
    core, structural, analysis = modules
    parameters = core.Parameters(json.dumps(settings(common)))

    class Counted(analysis.StructuralMechanicsAnalysis):  # type: ignore[name-defined]
        """Analysis that keeps the number of linear systems of each load step."""

        counts: tuple[int, ...] = ()

        def FinalizeSolutionStep(self) -> None:  # noqa: N802
            super().FinalizeSolutionStep()
            info = self._GetSolver().GetComputingModelPart().ProcessInfo
            self.counts = (*self.counts, info[core.NL_ITERATION_NUMBER])

    made.read()
    started = time.perf_counter()
    model = core.Model()
    stage = Counted(model, parameters)
    part = model["Structure"]
    fill(core, structural, part, common, made)
    try:
        stage.Run()
        converged = max(stage.counts) < MOST
    except RuntimeError:  # such as a singular matrix
        converged = False
    seconds = time.perf_counter() - started
    u = np.array([node.GetSolutionStepValue(core.DISPLACEMENT) for node in part.Nodes])[:, :2]
    reading, energy = results(common, made, u) if converged else (FAILED, math.nan)
    return Run(
        engine=ENGINE,
        problem=common.name,
        mesh_kind=kind,
        order=1,
        unknowns=made.unknowns(1),
        seconds_mesh=made.seconds,
        seconds=seconds,
        steps=sum(stage.counts),
        energy=energy,
        **asdict(reading),
    )


def results(common: Common, made: Mesh, u: Array) -> tuple[Reading, float]:
    """Reading and strain energy of nodal displacements (n, 2)."""
    own = np.concatenate([at for name, at in made.bodies.items() if name != OBSTACLE])
    force, energy = forces(made.points, made.triangles[own], u, *moduli(common))
    n = len(made.points)
    number = Numbering(made.points, np.arange(2 * n).reshape(2, n), made.edges)
    fixed, _ = prescribed(common, number)
    line = facing(common, number)
    nodal = np.where(fixed, 0.0, force.T.ravel())[line.at]
    nodal[np.abs(nodal) < ROUND_OFF * nodal.max()] = 0.0  # open nodes
    flat = u.T.ravel()
    gap = line.gap + flat[line.at] - (0.0 if line.opposite is None else flat[line.opposite])
    return read(common, line.x, nodal, gap, 1), energy
