"""Kratos: augmented Lagrangian mortar contact without friction, linear triangles.

Four load steps: in a single one it may report success with no contact at all. The plane body under
a rigid foundation's boundary is a mesh whose nodes are held.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Sequence
from typing import Any

import ngsolve as ng
import numpy as np

from drivers.benchmark.engines import Engine, Solved
from drivers.benchmark.engines.ngsolve import matrix, numbering, read_off
from drivers.benchmark.scenes.meshes import OBSTACLE, Mesh
from drivers.benchmark.scenes.plane import (
    Reading,
    contact_sides,
    modulus,
    prescribed,
    pressures,
    supports,
)
from drivers.benchmark.scenes.problems import Common

KRATOS = "KratosMultiphysics"
STRUCTURAL = f"{KRATOS}.StructuralMechanicsApplication"
CONTACT = f"{KRATOS}.ContactStructuralMechanicsApplication"
LOAD_STEPS = 4
MOST = 50  # linear systems in a load step; Kratos goes on without a word when they do not converge
FAILED = Reading(math.nan, math.nan, math.nan)
ROUND_OFF = 1e-6  # of nodal forces relative to the largest; the iteration stops before round-off


def process(module: str, part: str, variable: str, **parameters: Any) -> dict[str, Any]:
    """What grows with time from 0 to 1 on a part of the model."""
    return {
        "python_module": f"assign_vector_{module}_process",
        "kratos_module": KRATOS,
        "Parameters": {
            "model_part_name": f"Structure.{part}",
            "variable_name": variable,
            "interval": [0.0, "End"],
            **parameters,
        },
    }


def held(part: str, components: Sequence[float | None]) -> dict[str, Any]:
    """Displacements of a part of the model."""
    constrained = [u is not None for u in components] + [True]
    value = [None if u is None else f"{u}*t" for u in components] + [0.0]
    return process("variable", part, "DISPLACEMENT", constrained=constrained, value=value)


def pressed(part: str, pressure: float) -> dict[str, Any]:
    """Pressure downwards on a part of the model."""
    down = {"modulus": f"{pressure}*t", "direction": [0.0, -1.0, 0.0]}
    return process("by_direction_to_condition", part, "LINE_LOAD", **down)


def settings(common: Common) -> dict[str, Any]:
    """Kratos' project parameters; tolerances are its own defaults."""
    supported = [
        held(name, components)
        for pattern, components in supports(common).items()
        for name in pattern.split("|")
    ]
    if common.problem.contact[0].primary is None:
        supported.append(held(OBSTACLE, (0.0, 0.0)))
    contact = {
        "python_module": "alm_contact_process",
        "kratos_module": CONTACT,
        "process_name": "ALMContactProcess",
        "Parameters": {
            "model_part_name": "Structure",
            "contact_model_part": {"0": list(contact_sides(common))},
            # The secondary is the slave; with the other one systems turned out singular.
            "assume_master_slave": {"0": [common.problem.contact[0].secondary]},
            "contact_type": "Frictionless",
        },
    }
    return {
        "problem_data": {
            "problem_name": "benchmark",
            "parallel_type": "OpenMP",
            "start_time": 0.0,
            "end_time": 1 - 1e-9,  # the clock's round-off must not add a step
            "echo_level": 0,
        },
        "solver_settings": {
            "model_part_name": "Structure",
            "domain_size": 2,
            "solver_type": "Static",
            "echo_level": 0,
            "analysis_type": "non_linear",
            "model_import_settings": {"input_type": "use_input_model_part"},
            "material_import_settings": {"materials_filename": ""},
            "contact_settings": {
                "mortar_type": "ALMContactFrictionless",
                "fancy_convergence_criterion": False,
            },
            "time_stepping": {"time_step": 1 / LOAD_STEPS},
            # The criteria with multipliers go on long after the active set has settled.
            "convergence_criterion": "contact_residual_criterion",
            "max_iteration": MOST,
            "clear_storage": True,
            "reform_dofs_at_each_step": True,
            "linear_solver_settings": {"solver_type": "LinearSolversApplication.sparse_lu"},
        },
        "processes": {
            "constraints_process_list": supported,
            "loads_process_list": [pressed(*item) for item in pressures(common).items()],
            "contact_process_list": [contact],
        },
    }


def fill(core: Any, structural: Any, part: Any, common: Common, made: Mesh) -> None:
    """Nodes, triangles, boundaries and the material of `made` in Kratos' model part."""
    law, loaded = modulus(common), pressures(common)
    properties = part.CreateNewProperties(1)
    properties.SetValue(core.YOUNG_MODULUS, law.E)
    properties.SetValue(core.POISSON_RATIO, law.nu)
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
        if name not in loaded and name not in contact_sides(common):
            continue
        kind = "LineLoadCondition2D2N" if name in loaded else "LineCondition2D2N"
        first = count + 1
        for pair in (ends + 1).tolist():
            count += 1
            part.CreateNewCondition(kind, count, pair, properties)
        boundary.AddConditions(list(range(first, count + 1)))
    if OBSTACLE in made.bodies:
        nodes = np.unique(made.triangles[made.bodies[OBSTACLE]]) + 1
        part.CreateSubModelPart(OBSTACLE).AddNodes(nodes.tolist())


def by_mortar(modules: Any, common: Common, made: Mesh, order: int) -> Solved:
    """On vertices and triangles of the common mesh; NaN where Kratos fails."""
    core, structural, _, analysis, *_ = modules
    core.Logger.GetDefaultOutput().SetSeverity(core.Logger.Severity.WARNING)
    parameters = core.Parameters(json.dumps(settings(common)))

    class Counted(analysis.StructuralMechanicsAnalysis):  # type: ignore[name-defined]
        """Analysis that keeps the number of linear systems of each load step."""

        counts: tuple[int, ...] = ()

        def FinalizeSolutionStep(self) -> None:  # noqa: N802
            super().FinalizeSolutionStep()
            info = self._GetSolver().GetComputingModelPart().ProcessInfo
            self.counts = (*self.counts, info[core.NL_ITERATION_NUMBER])

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
    if not converged:
        return Solved(seconds, sum(stage.counts), math.nan, FAILED)
    mesh, v = made.copy(), u.T.ravel()
    pushed, number = matrix(common, ng.VectorH1(mesh, order=1)) @ v, numbering(mesh, 1)
    fixed, _ = prescribed(common, number)
    reading = read_off(common, number, v, np.where(fixed, 0.0, pushed), 1, ROUND_OFF)
    return Solved(seconds, sum(stage.counts), float(v @ pushed) / 2, reading)


MORTAR = Engine(
    "Kratos mortar",
    by_mortar,
    (
        *(KRATOS, STRUCTURAL, CONTACT),
        *(f"{STRUCTURAL}.structural_mechanics_analysis", f"{KRATOS}.LinearSolversApplication"),
    ),
    orders=(1,),
    meshed_obstacle=True,
    largest=16_000,
)
