"""NGSolve's own contact, `ContactBoundary` with a penalty energy, orders 1 and 2.

The tutorial's gap along the normal of a curved body loses half a percent of the force whatever
the mesh and the penalty, so the gap is taken along the direction of contact here. One search on
the bodies as they were is then exact, for displacements are small.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict

import ngsolve as ng
import numpy as np
from numpy.typing import NDArray

from drivers.benchmark.engines import Run
from drivers.benchmark.scenes.meshes import OBSTACLE, Mesh, made
from drivers.benchmark.scenes.ngsolve_plane import load, matrix, nodal, numbering, stiffness
from drivers.benchmark.scenes.plane import Numbering, facing, prescribed
from drivers.benchmark.scenes.problems import Common
from drivers.benchmark.scenes.reading import Reading, read

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

ENGINE = "NGSolve penalty"
# In units of E / h, all run: the best one depends on order and size. A small one takes few steps
# and errs less than the mesh does only while that is coarse.
PENALTIES = (10.0, 100.0, 1000.0)
REACH = 0.02  # largest distance at which the other side is searched, a length
STEPS = 100
ROUND_OFF = 1e-9  # of forces relative to the largest
CONVERGED = 1e-9  # unbalanced force relative to that before the first step
SHORTEST = 2**-10  # of a Newton step


def runs(common: Common, kinds: Sequence[str], sizes: Sequence[int]) -> Iterator[Run]:
    """Runs of orders 1 and 2 with each penalty, which is part of the engine's name.

    On meshes of the given kinds and numbers of unknowns.
    """
    obstacle = common.problem.contact[0].primary is None
    for kind in kinds:
        for order in (1, 2):
            for size in sizes:
                mesh = made(common, kind, order, size, obstacle)
                for penalty in PENALTIES:
                    yield run(common, kind, order, mesh, penalty)


def contact(common: Common, mesh: ng.Mesh, u: ng.CoefficientFunction, penalty: float) -> object:
    """Penalty energy of the gap between the two sides."""
    [pair] = common.problem.contact
    [law] = common.problem.materials.values()
    sides = [pair.secondary, pair.primary or f"{OBSTACLE}_contact"]
    boundary = ng.ContactBoundary(*(mesh.Boundaries(name) for name in sides))
    gap = ng.y + u[1] - (ng.y.Other() + u.Other()[1])
    stiffness = penalty * law.E / ng.specialcf.mesh_size  # type: ignore[union-attr]
    boundary.AddEnergy(ng.IfPos(gap, 0, stiffness / 2 * gap**2))
    return boundary


def minimised(form: ng.BilinearForm, f: ng.BaseVector, fixed: Mask, gf: ng.GridFunction) -> int:
    """Newton's method with step lengths halved until the energy falls; the number of steps."""
    free = ng.BitArray(~fixed)
    residual, step, before = (gf.vec.CreateVector() for _ in range(3))

    def energy() -> float:
        return float(form.Energy(gf.vec) - ng.InnerProduct(f, gf.vec))

    def unbalanced() -> float:
        form.Apply(gf.vec, residual)
        residual.data -= f
        return float(np.linalg.norm(residual.FV().NumPy()[~fixed]))

    start = size = unbalanced()
    value = energy()
    for count in range(STEPS):
        if size <= CONVERGED * start:
            return count
        form.AssembleLinearization(gf.vec)
        step.data = form.mat.Inverse(free, inverse="sparsecholesky") * residual
        before.data, length, last = gf.vec, 1.0, value
        while True:
            gf.vec.data = before - length * step
            value = energy()
            # Round-off decides between energies that agree.
            if value <= last + 1e-10 * abs(last) or length <= SHORTEST:
                break
            length /= 2
        size = unbalanced()
    raise RuntimeError(f"unbalanced force {size / start:.1e} after {STEPS} Newton steps")


def run(common: Common, kind: str, order: int, made: Mesh, penalty: float) -> Run:
    """One run, on a mesh curved to the order of the elements."""
    mesh = made.copy()
    started = time.perf_counter()
    mesh.Curve(order)
    space = ng.VectorH1(mesh, order=order)
    form = stiffness(common, space)
    pair = contact(common, mesh, space.TrialFunction(), penalty)
    gf = ng.GridFunction(space)
    pair.Update(gf, bf=form, intorder=2 * order, maxdist=REACH)  # type: ignore[attr-defined]
    f = load(common, space).Assemble().vec
    number = numbering(mesh, order)
    forward, _ = nodal(number)
    fixed, value = prescribed(common, number)
    fixed |= np.array(list(space.GetDofs(mesh.Materials(OBSTACLE))))
    gf.vec.FV().NumPy()[:] = forward @ value
    steps = minimised(form, f, fixed, gf)
    seconds = time.perf_counter() - started
    K = matrix(common, space)
    v = gf.vec.FV().NumPy()
    return Run(
        engine=f"{ENGINE} {penalty:g} E/h",
        problem=common.name,
        mesh_kind=kind,
        order=order,
        unknowns=made.unknowns(order),
        seconds_mesh=made.seconds,
        seconds=seconds,
        steps=steps,
        energy=float(v @ (K @ v)) / 2,
        **asdict(reading(common, number, v, np.where(fixed, 0.0, K @ v - f.FV().NumPy()), order)),
    )


def reading(common: Common, number: Numbering, v: Array, residual: Array, order: int) -> Reading:
    """Reading of unknowns and their unbalanced forces (n,) without the penalty."""
    forward, backward = nodal(number)
    line, nodes = facing(common, number), backward @ v
    force = (forward.T @ residual)[line.at]
    force[np.abs(force) < ROUND_OFF * force.max()] = 0.0  # open nodes
    there = 0.0 if line.opposite is None else nodes[line.opposite]
    return read(common, line.x, force, nodes[line.at] - there + line.gap, order)
