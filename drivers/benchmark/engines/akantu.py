"""Akantu: nodes against segments with a penalty; linear triangles on rigid foundations only.

What else was tried with Akantu 5.0.7 does not run: with a deformable primary its tangent matrix
counts the coupling of the two sides twice (a common translation takes forces) and Newton's method
diverges; gaps to quadratic segments end in "computeD2NDS2 : not implemented yet".
"""

from __future__ import annotations

import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from drivers.benchmark.engines import PENALTIES, Engine, Solved
from drivers.benchmark.scenes.meshes import OBSTACLE, Mesh
from drivers.benchmark.scenes.plane import facing, interleaved, modulus, prescribed, read
from drivers.benchmark.scenes.problems import Common

LOAD_STEPS = 4  # in one, the search may miss nodes that are many elements deep: no force, no word
STEPS = 100  # of Newton's method in a load step
CONVERGED = 1e-9  # unbalanced force relative to E times the largest prescribed displacement


def gmsh(made: Mesh) -> str:
    """The mesh in Gmsh's format 2.2, where segments have the number 1 and triangles 2."""
    parts = [(1, name, ends) for name, ends in made.edges.items()]
    parts += [(2, name, made.triangles[at]) for name, at in made.bodies.items()]
    names: list[str] = []
    elements: list[str] = []
    for number, (dimension, name, nodes) in enumerate(parts, start=1):
        names.append(f'{dimension} {number} "{name}"')
        for row in (nodes + 1).tolist():
            head = f"{len(elements) + 1} {dimension} 2 {number} {number} "
            elements.append(head + " ".join(map(str, row)))
    points = [f"{k} {x} {y} 0" for k, (x, y) in enumerate(made.points.tolist(), start=1)]
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat"]
    for title, rows in (("PhysicalNames", names), ("Nodes", points), ("Elements", elements)):
        lines += [f"${title}", str(len(rows)), *rows, f"$End{title}"]
    return "\n".join(lines) + "\n"


def settings(common: Common, made: Mesh, penalty: float) -> str:
    """Materials and contact in Akantu's format; the penalty in units of E / h, h the smallest."""
    law, [contact] = modulus(common), common.problem.contact
    ends = made.points[made.edges[contact.secondary]]
    h = np.hypot(*(ends[:, 1] - ends[:, 0]).T).min()
    elastic = {"rho": 1.0, "E": law.E, "nu": law.nu}
    detector = {
        "type": "explicit",
        "master": f"{OBSTACLE}_contact",
        "slave": contact.secondary,
        "projection_tolerance": 1e-10,
        "max_iterations": 100,
        "extension_tolerance": 1e-5,
    }
    resolution = {
        "name": contact.secondary,
        "mu": 0.0,
        "epsilon_n": penalty * law.E / h,
        "epsilon_t": 0.0,
        "is_master_deformable": "false",
    }
    sections: list[tuple[str, dict[str, Any]]] = [
        *(("material elastic", {"name": body, **elastic}) for body in made.bodies),
        ("contact_detector", detector),
        ("contact_resolution penalty_linear", resolution),
    ]
    lines = []
    for title, values in sections:
        lines += [f"{title} [", *(f"{key} = {value}" for key, value in values.items()), "]"]
    return "\n".join(lines)


def parsed(akantu: Any, mesh: str, settings: str) -> Any:
    """Akantu's mesh, after the settings have been read."""
    with TemporaryDirectory() as folder:
        files = [Path(folder) / "settings.dat", Path(folder) / "mesh.msh"]
        for path, text in zip(files, (settings, mesh), strict=True):
            path.write_text(text)
        akantu.parseInput(str(files[0]))
        result = akantu.Mesh(2)
        result.read(str(files[1]))
    return result


def by_penalty(modules: Any, common: Common, made: Mesh, order: int, penalty: float) -> Solved:
    """On vertices and triangles of the common mesh; supports move in load steps."""
    [akantu] = modules
    mesh = parsed(akantu, gmsh(made), settings(common, made, penalty))
    started = time.perf_counter()
    coupler = akantu.CouplerSolidContact(mesh)
    solid, contact = coupler.getSolidMechanicsModel(), coupler.getContactMechanicsModel()
    # Akantu keeps no reference to either selector.
    materials = akantu.MeshDataMaterialSelectorString("physical_names", solid)
    solid.setMaterialSelector(materials)
    coupler.initFull(_analysis_method=akantu._static)
    surfaces = akantu.PhysicalSurfaceSelector(mesh)
    contact.getContactDetector().setSurfaceSelector(surfaces)
    _, _, numbering = interleaved(common, made, 1)
    fixed, value = prescribed(common, numbering)
    held = np.unique(made.triangles[made.bodies[OBSTACLE]])
    fixed[numbering.unknown[:, held]] = True
    fixed, value = fixed.reshape(-1, 2), value.reshape(-1, 2)
    newton = coupler.getNonLinearSolver()
    solid.getBlockedDOFs()[:] = fixed
    newton.set("max_iterations", STEPS)
    newton.set("threshold", CONVERGED * modulus(common).E * np.abs(value).max())
    newton.set("convergence_type", akantu.SolveConvergenceCriteria.residual)
    u, steps = solid.getDisplacement(), 0
    for step in range(1, LOAD_STEPS + 1):
        u[fixed] = value[fixed] * step / LOAD_STEPS
        coupler.solveStep()
        steps += newton.getInt("nb_iterations")
    seconds = time.perf_counter() - started
    line = facing(common, numbering)
    force = np.array(contact.getNormalForce()).ravel()[line.at]
    gap = line.gap + np.array(u).ravel()[line.at]
    reading = read(common, line.x, force, gap, 1)
    return Solved(seconds, steps, solid.getEnergy("potential"), reading)


PENALTY = Engine(
    *("Akantu penalty", by_penalty, ("akantu",), (1,), PENALTIES),
    meshed_obstacle=True,
    two_bodies=False,
    largest=4_000,
)
