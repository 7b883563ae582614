"""A discrete solution and its data on the triangles, in units of its own."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import ngsolve as ng
import numpy as np

from ....arrays import Array, Index, Mask, power_of_two
from ....fem import BoundaryTrace, narrow_forces, shear_moduli
from ....problem import Problem, Triangulation, varies
from .balance import Balance, Units, balance_of
from .curves import PLACES, CurvedEdges, bent_segments, curved_edges, curved_moments, edge_places
from .forces import Forces, forces_on
from .partition import Partition, of_body
from .polynomials import basis, dimension, lattice
from .sampled import Rough, meridian_triangles, rough_triangles


@dataclass(frozen=True, eq=False)
class Discrete:
    """A discrete solution on n triangles, in units of its own.

    Attributes
    ----------
    partition : Partition
        The triangles.
    balance : Balance
        What equilibrium is.
    order : int
        Degree p of the displacement.
    law : ndarray (n, v, v)
        Moduli.
    root : ndarray (n, v, v)
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
    radial : ndarray (n,)
        Radial forces times r in the middles; 0 in the plane.
    rough : Rough or None
        Triangles for which the polynomials above do not hold; there `force` are means over the
        triangle of the forces times polynomials.
    curves : CurvedEdges
        Curved edges.
    moments : ndarray (c, r, 3 l)
        Tractions on them.
    """

    partition: Partition
    balance: Balance
    order: int
    law: Array
    root: Array
    stress: Array
    force: Array
    forces: Forces
    degree: int
    geometry: int
    radial: Array
    rough: Rough | None
    curves: CurvedEdges
    moments: Array

    def least_measure(self, at: Index) -> Array:
        """What places in the triangles `at` (b,) count for at least, (b,).

        Raises
        ------
        ValueError
            Triangles at an axis, where that is nothing.
        """
        partition, triangles = self.partition, self.partition.triangles[at]
        if self.balance.at_axis(partition)[triangles].any():
            raise ValueError(
                "no guaranteed bound is known where loads at the axis are no polynomials; "
                "use error_estimate"
            )
        edges = partition.edges[at]
        t = np.broadcast_to(np.linspace(0, 1, PLACES), (edges.size, PLACES))
        x, _ = edge_places(partition, edges.ravel(), self.curves, t)
        return np.asarray(self.balance.measure(x).reshape(len(at), -1).min(axis=1))

    @property
    def motion_degree(self) -> int:
        """Degree of the polynomials that stand for rigid motions on edges."""
        return self.degree if self.curves.guided.any() else self.geometry

    @cached_property
    def lacking(self) -> Mask:
        """Triangles (n,) with a side on an axis, which lack some tractions."""
        partition = self.partition
        return np.asarray(self.balance.at_axis(partition)[partition.triangles].sum(axis=1) > 1)

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
    return max(3, boundary.order + 1) + boundary.model.extent


def units_of(problem: Problem, boundary: BoundaryTrace, stress: ng.CoefficientFunction) -> Units:
    """Units of a solution."""
    mesh = boundary.mesh
    points = mesh.MapToAllElements(ng.IntegrationRule([(1 / 3, 1 / 3, 0)], [1]), ng.VOL)
    return Units(
        stress=power_of_two(np.asarray(stress(points))),
        modulus=power_of_two(shear_moduli(problem, mesh)),
        length=power_of_two(np.ptp(Triangulation(mesh).vertices, axis=0)),
        extent=boundary.model.extent,
    )


def discrete_on(
    problem: Problem,
    boundary: BoundaryTrace,
    partition: Partition,
    stress: ng.CoefficientFunction,
    units: Units,
    degree: int,
    hoop: ng.CoefficientFunction | None = None,
) -> Discrete:
    """A discrete stress, and a hoop stress about an axis, with data on a partition's triangles.

    `degree` is that of the equilibrated stress.
    """
    every = np.arange(len(partition.triangles))
    xx, xy, _, yy = stress
    if hoop is not None:
        return _about_axis(problem, boundary, partition, ng.CF((xx, yy, hoop, xy)), units, degree)
    region = Triangulation(partition.mesh).bodies[partition.parent]
    law = _laws(problem, partition, region, 3) / units.modulus
    order, geometry = boundary.order, boundary.geometry_order
    points = lattice(order - 1)
    components = ng.CF((xx, yy, xy)).Compile()
    values = partition.evaluate(components, every, points) / units.stress
    fit = basis(max(order - 1, 1)).values(points)[:, : dimension(order - 1)]
    coefficients = np.einsum("iq,nqc->nci", np.linalg.inv(fit), values)
    narrow = narrow_forces(problem, partition.mesh, order)[partition.parent]
    unit = units.stress / units.length
    forces = forces_on(problem.force, partition, region, degree, unit, narrow)
    force = forces.hatted.copy()
    curves = curved_edges(problem, boundary, partition)
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
        balance=balance_of(boundary.model),
        order=order,
        law=law,
        root=np.asarray(np.linalg.cholesky(law)),
        stress=coefficients,
        force=force,
        forces=forces,
        degree=degree,
        geometry=geometry,
        radial=np.zeros(len(every)),
        rough=rough,
        curves=curves,
        moments=curved_moments(partition, curves, degree, geometry),
    )


def _laws(problem: Problem, partition: Partition, region: Index, size: int) -> Array:
    """Moduli (n, v, v), v = `size`, by the body of each triangle; one of it stands for all."""
    law = np.zeros((len(region), size, size))
    for pattern, material in problem.materials.items():
        at = of_body(partition.mesh, pattern, region)
        C = partition.evaluate(material.voigt(problem.model), at[:1], np.array([[1 / 3, 1 / 3]]))
        law[at] = C.reshape(-1, size, size)
    return law


def _about_axis(
    problem: Problem,
    boundary: BoundaryTrace,
    partition: Partition,
    voigt: ng.CoefficientFunction,
    units: Units,
    degree: int,
) -> Discrete:
    """The same in a meridian section."""
    region = Triangulation(partition.mesh).bodies[partition.parent]
    law = _laws(problem, partition, region, 4) / units.modulus
    geometry = boundary.geometry_order
    curves = curved_edges(problem, boundary, partition)
    scales = units.stress, units.modulus
    rough = meridian_triangles(problem, partition, geometry, degree, voigt.Compile(), law, scales)
    F = partition.mesh.MaterialCF(problem.force, default=ng.CF((0, 0)))
    radial = partition.evaluate(ng.x * F[0], np.arange(len(region)), np.array([[1 / 3, 1 / 3]]))
    axial = {body: ng.CF((0, boundary.model.weighted(F[1]))) for body, F in problem.force.items()}
    narrow = narrow_forces(problem, partition.mesh, boundary.order)[partition.parent]
    unit = units.traction / units.length
    forces = forces_on(axial, partition, region, degree, unit, narrow)
    axis = balance_of(boundary.model).at_axis(partition)[partition.triangles].any(axis=1)
    near = np.flatnonzero(axis | (curves.number[partition.edges] >= 0).any(axis=1))
    return Discrete(
        partition=partition,
        balance=balance_of(boundary.model),
        order=boundary.order,
        law=law,
        root=np.asarray(np.linalg.cholesky(law)),
        stress=np.zeros((len(region), 3, 0)),
        force=np.repeat(rough.force_means[:, None] / 3, 3, axis=1),
        forces=forces.but_on(near, rough.missed[near]),
        degree=degree,
        geometry=geometry,
        radial=radial.reshape(-1) / units.stress,
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
