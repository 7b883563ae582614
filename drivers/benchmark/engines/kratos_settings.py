"""The common problems as parameters of Kratos' analysis."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from drivers.benchmark.scenes.meshes import OBSTACLE
from drivers.benchmark.scenes.plane import pressures, supports
from drivers.benchmark.scenes.problems import Common

KRATOS = "KratosMultiphysics"
STRUCTURAL = f"{KRATOS}.StructuralMechanicsApplication"
CONTACT = f"{KRATOS}.ContactStructuralMechanicsApplication"
LOAD_STEPS = 4
MOST = 50  # linear systems in a load step; Kratos goes on without a word when they do not converge


def sides(common: Common) -> tuple[str, str]:
    """Boundaries of the secondary and the primary."""
    [contact] = common.problem.contact
    return contact.secondary, contact.primary or f"{OBSTACLE}_contact"


def held(part: str, components: Sequence[float | None]) -> dict[str, Any]:
    """Displacements of a part of the model that grow with time from 0 to 1."""
    return {
        "python_module": "assign_vector_variable_process",
        "kratos_module": KRATOS,
        "Parameters": {
            "model_part_name": f"Structure.{part}",
            "variable_name": "DISPLACEMENT",
            "constrained": [u is not None for u in components] + [True],
            "value": [None if u is None else f"{u}*t" for u in components] + [0.0],
            "interval": [0.0, "End"],
        },
    }


def pressed(part: str, pressure: float) -> dict[str, Any]:
    """Pressure downwards on a part of the model that grows with time from 0."""
    return {
        "python_module": "assign_vector_by_direction_to_condition_process",
        "kratos_module": KRATOS,
        "Parameters": {
            "model_part_name": f"Structure.{part}",
            "variable_name": "LINE_LOAD",
            "modulus": f"{pressure}*t",
            "direction": [0.0, -1.0, 0.0],
            "interval": [0.0, "End"],
        },
    }


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
            "contact_model_part": {"0": list(sides(common))},
            # The secondary is the slave; with the other one systems turned out singular.
            "assume_master_slave": {"0": [sides(common)[0]]},
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
