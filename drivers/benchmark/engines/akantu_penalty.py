"""Akantu: nodes against segments with a penalty; linear triangles on rigid foundations only.

What else was tried with Akantu 5.0.7 does not run: with a deformable primary its tangent matrix
counts the coupling of the two sides twice (a common translation takes forces) and Newton's method
diverges; gaps to quadratic segments end in "computeD2NDS2 : not implemented yet".
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType
from typing import Any

import numpy as np

from drivers.benchmark.engines import Run, needed
from drivers.benchmark.engines.ngsolve_penalty import PENALTIES
from drivers.benchmark.scenes.meshes import OBSTACLE, Mesh, made
from drivers.benchmark.scenes.nodes import interleaved
from drivers.benchmark.scenes.plane import Numbering, facing, prescribed
from drivers.benchmark.scenes.problems import Common
from drivers.benchmark.scenes.reading import read

ENGINE = "Akantu penalty"
LOAD_STEPS = 4  # in one, the search may miss nodes that are many elements deep: no force, no word
STEPS = 100  # of Newton's method in a load step
CONVERGED = 1e-9  # unbalanced force relative to E times the largest prescribed displacement


def runs(common: Common, kinds: Sequence[str], sizes: Sequence[int]) -> Iterator[Run]:
    """Runs of order 1 with each penalty, which is part of the engine's name.

    On meshes of the given kinds and numbers of unknowns; none where two bodies meet.

    Raises
    ------
    NotInstalledError
        Akantu is missing.
    """
    [akantu] = needed(ENGINE, "akantu")
    if common.problem.contact[0].primary is not None:
        return
    for kind in kinds:
        for size in sizes:
            mesh = made(common, kind, 1, size, obstacle=True)
            for penalty in PENALTIES:
                yield run(akantu, common, kind, mesh, penalty)


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
    [law] = common.problem.materials.values()
    [contact] = common.problem.contact
    ends = made.points[made.edges[contact.secondary]]
    h = np.hypot(*(ends[:, 1] - ends[:, 0]).T).min()
    elastic = {"rho": 1.0, "E": law.E, "nu": law.nu}  # type: ignore[union-attr]
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
        "epsilon_n": penalty * elastic["E"] / h,
        "epsilon_t": 0.0,
        "is_master_deformable": "false",
    }
    sections = [("material elastic", {"name": body, **elastic}) for body in made.bodies]
    sections += [("contact_detector", detector)]
    sections += [("contact_resolution penalty_linear", resolution)]
    lines = []
    for title, values in sections:
        lines += [f"{title} [", *(f"{key} = {value}" for key, value in values.items()), "]"]
    return "\n".join(lines)


def parsed(akantu: ModuleType, mesh: str, settings: str) -> Any:
    """Akantu's mesh, after the settings have been read."""
    with TemporaryDirectory() as folder:
        files = [Path(folder) / "settings.dat", Path(folder) / "mesh.msh"]
        for path, text in zip(files, (settings, mesh), strict=True):
            path.write_text(text)
        akantu.parseInput(str(files[0]))
        result = akantu.Mesh(2)
        result.read(str(files[1]))
    return result


def run(akantu: ModuleType, common: Common, kind: str, made: Mesh, penalty: float) -> Run:
    """One run on vertices and triangles of the common mesh."""
    made.read()
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
    steps = solved(akantu, coupler, common, made, numbering)
    seconds = time.perf_counter() - started
    line = facing(common, numbering)
    force = np.array(contact.getNormalForce()).ravel()[line.at]
    gap = line.gap + np.array(solid.getDisplacement()).ravel()[line.at]
    return Run(
        engine=f"{ENGINE} {penalty:g} E/h",
        problem=common.name,
        mesh_kind=kind,
        order=1,
        unknowns=made.unknowns(1),
        seconds_mesh=made.seconds,
        seconds=seconds,
        steps=steps,
        energy=solid.getEnergy("potential"),
        **asdict(read(common, line.x, force, gap, 1)),
    )


def solved(
    akantu: ModuleType, coupler: Any, common: Common, made: Mesh, numbering: Numbering
) -> int:
    """Supports moved in load steps, the obstacle held; the number of linear systems."""
    fixed, value = prescribed(common, numbering)
    held = np.unique(made.triangles[made.bodies[OBSTACLE]])
    fixed[numbering.unknown[:, held]] = True
    fixed, value = fixed.reshape(-1, 2), value.reshape(-1, 2)
    solid, newton = coupler.getSolidMechanicsModel(), coupler.getNonLinearSolver()
    solid.getBlockedDOFs()[:] = fixed
    newton.set("max_iterations", STEPS)
    [law] = common.problem.materials.values()
    newton.set("threshold", CONVERGED * law.E * np.abs(value).max())  # type: ignore[union-attr]
    newton.set("convergence_type", akantu.SolveConvergenceCriteria.residual)
    u, steps = solid.getDisplacement(), 0
    for step in range(1, LOAD_STEPS + 1):
        u[fixed] = value[fixed] * step / LOAD_STEPS
        coupler.solveStep()
        steps += newton.getInt("nb_iterations")
    return steps
