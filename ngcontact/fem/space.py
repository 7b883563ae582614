"""The space V_h of HH81 (2.2), (2.4), (2.9): stiffness A, load f, stresses, energies."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import ngsolve as ng
import numpy as np
import scipy.sparse as sp

from ..arrays import Array, Index, Mask, for_components, power_of_two
from ..linalg import shared
from ..problem import Elastic, Hooke, MeshArrays, Problem, body_mask, strain_components, varies
from ..quadrature import composite, loads_of
from .boundary import ORDERS, Bodies, BoundaryTrace, physical_basis, vector_space
from .model import MODELS, SOLID_MODEL, Model
from .moduli import rough_moduli

LOAD_BONUS = 6  # quadrature orders above the default: loads may be as rough as r^(-1/2)
CANCELLED_ENERGY = 1e-6  # energy relative to its terms below which fewer than ten digits are left
ROUGH_PARTS = 8  # of the sides of an element in which a law is rough, each with a rule of its own
MODULUS_BONUS = 4  # quadrature orders above the default: moduli may be as rough as r^(-1/2)
# ... and for the map of a curved element, where derivatives are no polynomials: the default rule
# changes u_h by up to 15 % of its error at order 2, this one by 0.05 %.
CURVED = 2


@dataclass(frozen=True, eq=False)
class Space:
    """V_h with the assembled forms (3.1), (3.2): N unknowns for each component."""

    V: ng.FESpace
    trace: BoundaryTrace  # boundary nodes
    nodal: Index  # (k,), segments of the trace on which conditions are posed at nodes
    # (2N, 2n) from n node values there, and unknowns elsewhere, to the unknowns of V.
    basis: sp.csr_array
    form: ng.BilinearForm
    # (2N, 2N), its stiffness, in the memory of `form.mat`; where there are unknowns `inner`, of
    # elements alone, the Schur complement of these, whose rows are empty (static condensation)
    A: sp.csr_array
    inner: Mask  # (2N,)
    f: Array  # (2N,), load
    initial: Array | None  # (2N,), what initial strains add to that, if there are any

    @property
    def right_side(self) -> Array:
        """Load with initial strains, (2N,): A u is this where nothing is held."""
        return self.f if self.initial is None else self.f + self.initial

    def _times(self, operator: ng.BaseMatrix, x: Array) -> Array:
        """An operator of the form times `x` (2N,), which is (2N,)."""
        right, product = self.form.mat.CreateRowVector(), self.form.mat.CreateColVector()
        right.FV().NumPy()[:] = x
        product.data = operator * right
        return np.asarray(product.FV().NumPy())

    def condensed(self, f: Array) -> Array:
        """The load (2N,) on A of a load `f` (2N,): f_b - A_bi A_ii^-1 f_i, none at inner i."""
        if not self.inner.any():
            return f
        return np.where(self.inner, 0.0, f + self._times(self.form.harmonic_extension_trans, f))

    def extended(self, u: Array, f: Array | None = None) -> Array:
        """Unknowns (2N,): `u` (2N,) but for inner ones, of least energy under a load `f` (2N,)."""
        if not self.inner.any():
            return u
        inner = self._times(self.form.harmonic_extension, np.where(self.inner, 0.0, u))
        if f is not None:
            inner = inner + self._times(self.form.inner_solve, f)
        return np.where(self.inner, inner, u)

    def energy(self, u: Array) -> float:
        """A(u, u) of HH81 (3.1) for a displacement `u` (2N,)."""
        energy = float(u @ (self.A @ u))
        if self.inner.any():
            left = np.where(self.inner, u - self.extended(u), 0.0)
            energy += float(left @ self._times(self.form.inner_matrix, left))
        return energy

    @cached_property
    def diagonal(self) -> Array:
        """Diagonal of A, (2N,), force per displacement and unit thickness."""
        return np.asarray(self.A.diagonal())

    def terms(self, displacement: ng.GridFunction) -> float:
        """Root of the sum of squares whose differences the energy of a displacement is."""
        u = self.unknowns(displacement)
        size = power_of_two(u)  # squares must stay in range
        return size * float(np.sqrt(self.diagonal @ (u / size) ** 2))

    def unknowns(self, displacement: ng.GridFunction) -> Array:
        """The unknowns (2N,) of a displacement, of a mesh that is as it was."""
        self.require_mesh()
        return np.asarray(displacement.vec.FV().NumPy())

    def require_mesh(self) -> None:
        """Raise a RuntimeError where the mesh was changed in place, so that no data fit it."""
        here, then = MeshArrays(self.V.mesh).vertices, self.trace.arrays.vertices
        if not np.array_equal(here, then):
            moved = "other places of them" if len(here) == len(then) else f"{len(here)} now"
            raise RuntimeError(
                f"the mesh was changed after solving: {len(then)} vertices then, {moved}; "
                "solve again, or refine a copy, ngsolve.Mesh(mesh.ngmesh.Copy())"
            )

    def stiffness(self) -> Array:
        """Force per displacement of the nodes, (n,), by its order of magnitude."""
        B = self.basis
        squares = B.data**2 * np.repeat(self.diagonal, np.diff(B.indptr))
        diagonal = np.bincount(B.indices, squares, B.shape[1])
        return diagonal.reshape(self.trace.model.dim, -1).max(axis=0)


def model_of(problem: Problem) -> Model:
    """The model of a problem."""
    return MODELS.get(problem.model, SOLID_MODEL)


def load_vector(problem: Problem, V: ng.FESpace, bonus: int) -> Array:
    """f(v) of (3.2), (2N,), by rules `bonus` orders above the default, or by moments of a load."""
    v, model, mesh = V.TestFunction(), model_of(problem), V.mesh
    f = ng.LinearForm(V)
    for load in loads_of(problem, mesh):
        found, w = load.where_rough(V.globalorder), v if load.kind == "force" else v.Trace()
        rough = np.zeros(0, dtype=bool) if found is None else found.rough
        densities = [load.density] if found is None else [load.density, found.projection]
        measures = _measures(load.region, rough, bonus, bonus_intorder=bonus)
        for density, dx in zip(densities, measures, strict=True):
            f += model.weighted(density * w) * dx  # (3.2)
    f.Assemble()
    return f.vec.FV().NumPy().copy()


def _measures(
    region: ng.Region, some: Mask, bonus: int, **rules: Any
) -> list[ng.comp.DifferentialSymbol]:
    """Integrals over a region, `bonus` orders above the default, the last by `rules` on `some`."""
    dx = ng.dx if region.VB() == ng.VOL else ng.ds
    if not some.any():
        return [dx(definedon=region, bonus_intorder=bonus)]
    usual, others = ng.BitArray(~some), ng.BitArray(some)
    return [
        dx(definedon=region, definedonelements=usual, bonus_intorder=bonus),
        dx(definedon=region, definedonelements=others, **rules),
    ]


def law_measures(
    mesh: ng.Mesh, body: str, order: int, rough: Mask
) -> list[ng.comp.DifferentialSymbol]:
    """Integrals over a body whose law varies, the last one over its elements `rough` (ne,).

    Of a polynomial of degree `order`, which is that of the form without the law, times the law.
    """
    rule = {ng.TRIG: composite(ROUGH_PARTS, order + CURVED)}
    return _measures(mesh.Materials(body), rough, MODULUS_BONUS, intrules=rule)


def initial_load(problem: Problem, V: ng.FESpace, trace: BoundaryTrace) -> Array | None:
    """The integral of C e0 : e(v), (2N,), for initial strains e0; None without.

    By the rule of the stiffness: u_h with e(u_h) = e0 is then without stress to round-off.
    """
    e0 = initial_strain(problem, V.mesh)
    if e0 is None:
        return None
    model, v, f = model_of(problem), V.TestFunction(), ng.LinearForm(V)
    rough = rough_moduli(problem, V.mesh)
    for body, law in problem.materials.items():
        # Once at each point: a function of another mesh looks for it there.
        stress = ng.CacheCF(model.stress(law.voigt(problem.model), e0))
        density = model.weighted(ng.InnerProduct(stress, model.strain(v)))
        for dx in _form_measures(trace, body, body in problem.varying, rough):
            f += density * dx
    f.Assemble()
    return f.vec.FV().NumPy().copy()


def _form_measures(
    trace: BoundaryTrace, body: str, varying: bool, rough: Mask
) -> list[ng.comp.DifferentialSymbol]:
    """Integrals over a body of the forms of stiffness, and of others that are to match it."""
    if varying:
        return law_measures(trace.mesh, body, 2 * trace.order, rough)
    where, bonus = trace.mesh.Materials(body), trace.model.bonus
    return _measures(where, trace.curved_elements, bonus, bonus_intorder=CURVED + bonus)


def _stiffness(problem: Problem, trace: BoundaryTrace, V: ng.FESpace) -> ng.BilinearForm:
    """A(u, v) of (3.1), assembled."""
    mesh, model, fes = trace.mesh, model_of(problem), V
    if trace.order > ORDERS[-1]:  # the same unknowns by components: half the time at order 8
        fes = ng.FESpace([trace.space] * model.dim)
    u, v = fes.TrialFunction(), fes.TestFunction()
    condense = mesh.dim == 2 and trace.order > 2  # else no unknown is of one element alone
    a = ng.BilinearForm(fes, symmetric=True, condense=condense, store_inner=condense)
    rough = rough_moduli(problem, mesh)
    for body, law in problem.materials.items():
        measures = _form_measures(trace, body, varies(law), rough)
        for work in model.work(law.voigt(problem.model), u, v):  # (3.1)
            for dx in measures:
                a += work * dx
    return a.Assemble()


def assemble(
    problem: Problem,
    trace: BoundaryTrace,
    element: str,
    nodal: Index | None = None,
    known: Space | None = None,
) -> Space:
    """Space, stiffness and load of a problem on the mesh of `trace`, curved as `element` asks.

    Node values replace NGSolve's unknowns on the segments `nodal` (k,), all when left out. The
    stiffness is that of a `known` space, if there is one.
    """
    V = vector_space(trace.mesh, trace.order, element) if known is None else known.V
    nodal = np.arange(len(trace.region)) if nodal is None else nodal
    a = _stiffness(problem, trace, V) if known is None else known.form
    A = shared(a.mat)
    scalar = physical_basis(V, trace) if element == "physical" else trace.nodal_basis(nodal)
    return Space(
        V=V,
        trace=trace,
        nodal=nodal,
        basis=for_components(scalar, trace.model.dim),
        form=a,
        A=A,
        inner=(np.diff(A.indptr) == 0) & a.condense,
        f=load_vector(problem, V, LOAD_BONUS),
        initial=initial_load(problem, V, trace),
    )


def body_of_unknown(space: Space, bodies: Bodies) -> Index:
    """Number of the body that each unknown (2N,) of V_h belongs to."""
    # Vertices come first, so that the first entry of a row is one of an element of its body.
    vertex = np.empty(len(space.inner), dtype=np.intp)
    vertex[~space.inner] = space.A.indices[space.A.indptr[:-1][~space.inner]]
    if space.inner.any():  # for each component in the order of the elements
        of_element = space.trace.arrays.elements[:, 0]
        each = np.count_nonzero(space.inner) // (2 * len(of_element))
        vertex[space.inner] = np.tile(np.repeat(of_element, each), 2)
    return bodies.of_vertex[vertex]


def potential_energy(problem: Problem, space: Space, displacement: ng.GridFunction) -> float:
    """L(u_h) of HH81 (2.6), per unit thickness.

    With initial strains what the stress stores, half of (e - e0) : C (e - e0), less the work of
    the loads; in plane strain without E e0_zz^2 / 2, a constant that bars normal to the plane hold.
    """
    size, energy = _scaled_energy(problem, space, displacement)
    work = float(space.f / size @ (space.unknowns(displacement) / size))
    return (energy / 2 - work) * size * size  # (2.6)


def energy_norm(problem: Problem, space: Space, displacement: ng.GridFunction) -> float:
    """A(u_h, u_h)^(1/2), root of an energy: the norm of the stress, also with initial strains."""
    size, energy = _scaled_energy(problem, space, displacement)
    return math.sqrt(energy) * size


def _scaled_energy(
    problem: Problem, space: Space, displacement: ng.GridFunction
) -> tuple[float, float]:
    """A size s of the displacement, whose squares may leave the range, and A(u_h / s, u_h / s).

    From the strains where large rigid motions would cancel, and where there are initial ones.
    """
    u, mesh, order = space.unknowns(displacement), space.trace.mesh, space.trace.order
    size = power_of_two(u)
    if space.initial is None:
        energy = space.energy(u / size)
        if energy > CANCELLED_ENERGY * float(space.diagonal @ (u / size) ** 2):
            return size, energy
    model, energy = model_of(problem), 0.0
    e = elastic_strain(problem, displacement) / size
    for body, law in problem.materials.items():
        stress = model.stress(law.voigt(problem.model), e)
        density = model.weighted(ng.InnerProduct(stress, e)).Compile()
        bonus = MODULUS_BONUS if body in problem.varying else 0
        energy += ng.Integrate(density, mesh.Materials(body), order=2 * order + 2 + bonus)
    return size, energy


def initial_strains(
    problem: Problem, mesh: ng.Mesh
) -> dict[str, tuple[Elastic | Hooke, ng.CoefficientFunction]]:
    """Law and initial strain (6,) of each body of a mesh that has one, by its own name."""
    found: dict[str, tuple[Elastic | Hooke, ng.CoefficientFunction]] = {}
    for pattern, data in problem.strain.items():
        mine = body_mask(mesh, pattern)
        for key, law in problem.materials.items():
            at = np.flatnonzero(mine & body_mask(mesh, key))
            names = [mesh.GetMaterials()[k] for k in at]
            found |= {re.escape(name): (law, strain_components(data)) for name in names}
    return found


def initial_strain(problem: Problem, mesh: ng.Mesh) -> ng.CoefficientFunction | None:
    """The Voigt strain e0 (q,) of bodies that are without stress; None where there is none."""
    if not problem.strain:
        return None
    model = model_of(problem)
    by_body = {k: model.initial_strain(*x) for k, x in initial_strains(problem, mesh).items()}
    return mesh.MaterialCF(by_body, default=0 * next(iter(by_body.values())))


def elastic_strain(problem: Problem, displacement: ng.GridFunction) -> ng.CoefficientFunction:
    """Elastic strain e(u) - e0, of which the law makes the stress, Voigt (q,)."""
    e, e0 = model_of(problem).strain(displacement), initial_strain(problem, displacement.space.mesh)
    return e if e0 is None else e - e0


def voigt_stress(problem: Problem, displacement: ng.GridFunction) -> ng.CoefficientFunction:
    """The Voigt stress (q,) of a displacement, in the units of the moduli."""
    model, e = model_of(problem), elastic_strain(problem, displacement)
    laws = problem.materials.items()
    return displacement.space.mesh.MaterialCF(
        {body: model.stress(law.voigt(problem.model), e) for body, law in laws}
    )


def stress_of(problem: Problem, displacement: ng.GridFunction) -> ng.CoefficientFunction:
    """Stress (d, d) of a displacement, in the plane (2, 2), sigma_h, in units of the moduli."""
    return model_of(problem).in_plane(voigt_stress(problem, displacement))


def normal_stress_of(problem: Problem, displacement: ng.GridFunction) -> ng.CoefficientFunction:
    """Stress normal to the plane of a displacement, a scalar, in the units of the moduli."""
    voigt, mesh = voigt_stress(problem, displacement), displacement.space.mesh
    strains = initial_strains(problem, mesh)
    return model_of(problem).out_of_plane(problem.materials, strains, mesh, voigt)


def von_mises(stress: Array) -> Array:
    """Von Mises stress (k,) of `stress` (k, 4), xx, yy, xy, zz, of solids yz, xz, too, (k, 6)."""
    size = float(np.abs(stress).max(initial=0.0)) or 1.0  # squares must stay in range
    xx, yy, xy, zz, *others = stress.T / size
    shear = sum((other**2 for other in others), xy**2)
    return size * np.sqrt(((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 2 + 3 * shear)
