"""A discrete solution and its data on the triangles, in units of its own."""

from __future__ import annotations

from dataclasses import dataclass

import ngsolve as ng
import numpy as np

from ....arrays import Array, Index, Mask, power_of_two
from ....fem import BoundaryTrace, shear_moduli
from ....problem import Problem, Triangulation, varies
from .curves import CurvedEdges, bent_segments, curved_edges, curved_moments
from .forces import Forces, forces_on
from .partition import Partition, of_body
from .polynomials import basis, dimension, lattice
from .rough import Rough, rough_triangles

MANDEL = np.sqrt([1.0, 1.0, 2.0])  # by which (xx, yy, xy) have the products of tensors


@dataclass(frozen=True)
class Units:
    """Powers of 2 by which all numbers are divided: a stress, a modulus and a length."""

    stress: float
    modulus: float
    length: float

    @property
    def strain(self) -> float:
        """The strain that belongs to stress and modulus."""
        return self.stress / self.modulus


@dataclass(frozen=True, eq=False)
class Discrete:
    """A discrete solution on n triangles, in units of its own.

    Attributes
    ----------
    partition : Partition
        The triangles.
    order : int
        Degree p of the displacement.
    law : ndarray (n, 3, 3)
        Moduli.
    root : ndarray (n, 3, 3)
        Their Cholesky factors.
    stress : ndarray (n, 3, m)
        (xx, yy, xy) of sigma_h, coefficients of polynomials of degree p - 1.
    force : ndarray (n, 3, 2, j)
        Hats times body forces, coefficients of polynomials of degree k - 1.
    forces : Forces
        What of the body forces is balanced inside each triangle, or missed.
    degree : int
        Degree k of the equilibrated stress.
    geometry : int
        Degree of the curves.
    rough : Rough or None
        Triangles for which the polynomials above do not hold; there `force` are means over the
        triangle of the forces times polynomials.
    curves : CurvedEdges
        Curved edges.
    moments : ndarray (c, r, 3 l)
        Tractions on them.
    """

    partition: Partition
    order: int
    law: Array
    root: Array
    stress: Array
    force: Array
    forces: Forces
    degree: int
    geometry: int
    rough: Rough | None
    curves: CurvedEdges
    moments: Array

    def motions_gram(self) -> Array:
        """Means (n, 3, 3) over the straight area of products of polynomials of degree 1."""
        gram = np.tile(np.eye(3), (len(self.law), 1, 1))
        if self.rough is not None:
            gram[self.rough.at] = self.rough.gram
        return gram


def degree_for(boundary: BoundaryTrace) -> int:
    """Degree k of the equilibrated stress.

    Tractions on a curve are no polynomials of degree k: from 5 on stresses have the freedom to meet
    k + 1 moments of them, and what is missed is small from p + 2 on.
    """
    if bent_segments(boundary).size:
        return max(5, boundary.order + 2, boundary.geometry_order + 1)
    return max(3, boundary.order + 1)


def units_of(problem: Problem, boundary: BoundaryTrace, stress: ng.CoefficientFunction) -> Units:
    """Units of a solution."""
    mesh = boundary.mesh
    points = mesh.MapToAllElements(ng.IntegrationRule([(1 / 3, 1 / 3, 0)], [1]), ng.VOL)
    return Units(
        stress=power_of_two(np.asarray(stress(points))),
        modulus=power_of_two(shear_moduli(problem, mesh)),
        length=power_of_two(np.ptp(Triangulation(mesh).vertices, axis=0)),
    )


def discrete_on(
    problem: Problem,
    boundary: BoundaryTrace,
    partition: Partition,
    stress: ng.CoefficientFunction,
    units: Units,
) -> Discrete:
    """A discrete stress and its data on the triangles of a partition."""
    every, middle = np.arange(len(partition.triangles)), np.array([[1 / 3, 1 / 3]])
    law = np.zeros((len(every), 3, 3))
    region = Triangulation(partition.mesh).bodies[partition.parent]
    for pattern, material in problem.materials.items():
        at = of_body(partition.mesh, pattern, region)
        C = material.voigt(problem.model)
        law[at] = partition.evaluate(C, at[:1], middle).reshape(-1, 3, 3) / units.modulus
    order, degree, geometry = boundary.order, degree_for(boundary), boundary.geometry_order
    points = lattice(order - 1)
    xx, xy, _, yy = stress
    components = ng.CF((xx, yy, xy)).Compile()
    values = partition.evaluate(components, every, points) / units.stress
    fit = basis(max(order - 1, 1)).values(points)[:, : dimension(order - 1)]
    coefficients = np.einsum("iq,nqc->nci", np.linalg.inv(fit), values)
    forces = forces_on(problem, partition, region, degree, units.stress / units.length)
    force = forces.hatted.copy()
    bent = bent_segments(boundary)
    curves = curved_edges(partition, boundary, bent)
    at = _rough(problem, partition, curves, region)
    rough = None
    if at.size:
        scales = units.stress, units.modulus
        rough = rough_triangles(problem, partition, at, geometry, degree, components, law, scales)
        force[at] = rough.force_means[:, None] / 3
        curved = (curves.number[partition.edges[at]] >= 0).any(axis=1)
        forces = forces.but_on(at[curved], rough.missed[curved])
    return Discrete(
        partition=partition,
        order=order,
        law=law,
        root=np.asarray(np.linalg.cholesky(law)),
        stress=coefficients,
        force=force,
        forces=forces,
        degree=degree,
        geometry=geometry,
        rough=rough,
        curves=curves,
        moments=curved_moments(partition, curves, degree, geometry),
    )


def _rough(problem: Problem, partition: Partition, curves: CurvedEdges, region: Index) -> Index:
    """Triangles (r,) that are curved, or of a varying law."""
    rough: Mask = np.any(curves.number[partition.edges] >= 0, axis=1, keepdims=True)[:, 0]
    for pattern, law in problem.materials.items():
        if varies(law):
            rough[of_body(partition.mesh, pattern, region)] = True
    return np.flatnonzero(rough)
