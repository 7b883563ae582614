"""Moduli of elements: nearly incompressible bodies, and laws that change or jump inside elements.

Initial strains that change or jump count as laws do.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import ngsolve as ng
import numpy as np

from ..arrays import Array, Index, Mask
from ..errors import warn
from ..problem import Elastic, Hooke, MeshArrays, Problem, body_mask, numbers, varies
from ..quadrature import SampledElements, features_of, lattice

# kappa / mu from which a body counts as nearly incompressible: nu = 5/12; nowhere in plane stress.
NEARLY_INCOMPRESSIBLE = 6.0

# Change of a law in an element over its least value there, of an initial strain over its largest in
# the body, from which it is rough there, or jumps.
JUMP_CHANGE = 0.5
HALVINGS = 24  # of the distance between two points: what still changes across 1e-7 of it jumps

# What `_moduli` has of laws of numbers, by the model.
CONSTANT: WeakKeyDictionary[Elastic | Hooke, dict[str, Array]] = WeakKeyDictionary()

SHEARS = {3: 1, 4: 1, 6: 3}  # how many of the last components are shear

# Where a law that varies is looked at in each element: its middle and towards its corners.
SAMPLES = {
    2: ng.IntegrationRule(
        [(1 / 3, 1 / 3, 0), (0.1, 0.1, 0), (0.8, 0.1, 0), (0.1, 0.8, 0)], [1 / 8] * 4
    ),
    3: ng.IntegrationRule(
        [(0.25, 0.25, 0.25), *(tuple(0.1 + 0.6 * np.eye(4)[i, :3]) for i in range(4))], [1 / 30] * 5
    ),
}


@dataclass(frozen=True, eq=False)
class Moduli:
    """Moduli of the law in each element, stresses."""

    # Half the smallest eigenvalue of C on strains, c_0 / 2 in HH81 (2.7), the least in the
    # element: mu of isotropic laws with nu >= 0, and kappa below.
    shear: Array  # (ne,)
    # Largest kappa <= e : C e / (tr e)^2, in the middle: lambda + mu of isotropic laws in plane
    # strain, lambda + 2 mu / 3 about an axis.
    bulk: Array  # (ne,)
    # Half the largest eigenvalue of C less kappa (tr e)^2, the largest in the element: mu of
    # isotropic laws. Boundary values w in a half-plane store at most 2 mu |w|^2 in H^(1/2), as the
    # field without divergence among those with these values does.
    rigidity: Array  # (ne,)
    ratio: Array  # (ne,), of the bulk modulus and half the smallest eigenvalue, in the middle


def moduli_of(problem: Problem, mesh: ng.Mesh) -> Moduli:
    """Moduli of all elements."""
    region, of_region = MeshArrays(mesh).bodies, np.zeros((4, len(mesh.GetMaterials())))
    varying = []
    for pattern, law in problem.materials.items():
        mask = body_mask(mesh, pattern)
        if varies(law):
            varying.append((law, mask))
        else:
            of_region[:, mask] = _constant(law, problem.model, mesh)
    result = of_region[:, region]
    for law, mask in varying:
        at, rule = mask[region], SAMPLES[mesh.dim]
        points = mesh.MapToAllElements(rule, ng.VOL).reshape(-1, len(rule))[at]
        law_there = law.voigt(problem.model)
        C = np.asarray(law_there(points.ravel()))
        result[:, at] = _moduli(C.reshape(-1, len(rule), *law_there.dims))
    return Moduli(*result)


def _moduli(C: Array) -> Array:
    """Fields (4, k) of `Moduli` by laws `C` (k, n, q, q) at points of k elements."""
    strains, dilatation = mandel(C), np.ones(C.shape[-1])
    smallest = np.linalg.eigvalsh(strains)[..., 0]  # (2.7)
    dilatation[-SHEARS[C.shape[-1]] :] = 0.0
    # By Cauchy and Schwarz; round-off stays that of C, nearly singular or not.
    kappa = 1 / (np.linalg.solve(C, dilatation[:, None])[..., 0] @ dilatation)
    rest = strains - kappa[..., None, None] * np.outer(dilatation, dilatation)
    rigidity = np.linalg.eigvalsh(rest)[..., -1].max(axis=1) / 2
    ratio = 2 * kappa[:, 0] / smallest[:, 0]
    return np.array([smallest.min(axis=1) / 2, kappa[:, 0], rigidity, ratio])


def contact_modulus(problem: Problem, moduli: Moduli, *sides: Index) -> float:
    """E*, a stress: 1 / E* is the sum over sides of mean (1 - nu^2) / E, in plane stress 1 / E.

    The sides are elements (k,); one without any is rigid. Of laws that are not isotropic the
    modulus of shear and the bulk modulus of `Moduli` count.
    """
    compliance = 0.0
    for side in sides:
        if len(side):
            mu, kappa = moduli.shear[side].mean(), moduli.bulk[side].mean()
            kappa -= mu / 3 if problem.model.startswith("plane") else 0.0  # that of space
            compliance += (3 * kappa + 4 * mu) / (4 * mu * (3 * kappa + mu))
    return 1 / compliance


def _constant(law: Elastic | Hooke, model: str, mesh: ng.Mesh) -> Array:
    """The same (4, 1) of a law of numbers, made once."""
    kept = CONSTANT.setdefault(law, {})
    if model not in kept:
        rule = ng.IntegrationRule([(1 / 3, 1 / 3, 0)], [1])
        C = np.asarray(law.voigt(model)(mesh.MapToAllElements(rule, ng.VOL)[:1]))
        size = round(math.sqrt(C.size))
        kept[model] = _moduli(C.reshape(1, 1, size, size))
    return kept[model]


def mandel(C: Array) -> Array:
    """Laws (..., q, q) on the strain e itself, energy e : C : e / 2, of Voigt's `C` (..., q, q).

    Shear strain is counted twice in e : e, so it is scaled by the root of 2.
    """
    scale = np.ones(C.shape[-1])
    scale[-SHEARS[C.shape[-1]] :] = math.sqrt(2.0)
    return C * scale * scale[:, None]


def nearly_incompressible(mesh: ng.Mesh, limit: float, ratio: Array) -> dict[str, float]:
    """Largest kappa / mu, `ratio` (ne,) in elements, of each body where it exceeds a limit."""
    if not (ratio > limit).any():
        return {}
    bodies = mesh.GetMaterials()
    names = np.array(bodies)[MeshArrays(mesh).bodies]
    most = {name: float(ratio[names == name].max(initial=0.0)) for name in dict.fromkeys(bodies)}
    return {name: value for name, value in most.items() if value > limit}


@dataclass(frozen=True, eq=False)
class RoughElements:
    """Elements of about one size in which a law, or a strain, changes by a share of itself, k."""

    view: SampledElements
    C: ng.CoefficientFunction  # (q, q), or a strain of c components
    at: Index  # (k,)
    values: Array  # (k, n, q q), or (k, n, c), at the points of a lattice
    limit: Array  # (k,), of a change

    def jumps(self) -> list[tuple[Array, Array]]:
        """Places (2,), and values (2,) on both sides, one in each element that has any.

        From the points of a lattice at which a component is least and largest, the half of their
        distance across which it changes more is kept, again and again: a smooth change shrinks by
        that.
        """
        which, row = np.ptp(self.values, axis=1).argmax(axis=1), np.arange(len(self.at))
        of = self.values[row, :, which]  # the component (k, n) that changes most
        ends = np.column_stack([of.argmin(axis=1), of.argmax(axis=1)])
        x, u = lattice(2, round(of.shape[1] ** 0.5))[ends], of[row[:, None], ends]
        for _ in range(HALVINGS):
            middle = x.mean(axis=1)
            v = self.view.sample(self.C, self.at, middle[:, None])[row, 0, which]
            side = (np.abs(v - u[:, 0]) > np.abs(v - u[:, 1])).astype(int)  # which end to move
            x[row, side], u[row, side] = middle, v
        kept = np.ptp(u, axis=1) > self.limit
        places = self.view.positions(self.at[kept], x[kept, 0])
        return list(zip(places, u[kept], strict=True))


def _rough(problem: Problem, mesh: ng.Mesh) -> Iterator[tuple[str, RoughElements]]:
    """Elements in which laws are rough, then initial strains, by the body."""
    if mesh.dim == 3:
        return
    view, rough = SampledElements(mesh, 2), list[tuple[str, Any, float | None]]()
    for name, law in problem.materials.items():
        rough += [(name, law.voigt(problem.model), None)] if varies(law) else []
    if not all(map(numbers, problem.strain.values())):
        strains = (one for one in features_of(problem, mesh) if one.kind == "strain")
        rough += [(one.name, problem.strain[one.name], one.largest) for one in strains]
    for pattern, f, largest in rough:
        words = f'materials "{pattern}"' if largest is None else f'initial strains of "{pattern}"'
        for here, values in view.samples(f, view.inside(mesh.Materials(pattern))):
            size = np.full(len(here), largest)
            if largest is None:  # the least mean of the diagonal
                size = values[..., :: f.dims[0] + 1].mean(axis=2).min(axis=1)
            k = np.flatnonzero(np.ptp(values, axis=1).max(axis=1) > JUMP_CHANGE * size)
            if len(k):
                yield words, RoughElements(view, f, here[k], values[k], JUMP_CHANGE * size[k])


def rough_moduli(problem: Problem, mesh: ng.Mesh) -> Mask:
    """Elements (ne,) in which the law, or an initial strain, varies by half of itself, or jumps."""
    rough = np.zeros(mesh.ne, dtype=bool)
    for _, elements in _rough(problem, mesh):
        rough[elements.at] = True
    return rough


def warn_of_jumps(problem: Problem, mesh: ng.Mesh) -> None:
    """Warn of every law, or strain, that jumps inside elements, where it jumps most."""
    jumps: dict[str, list[tuple[Array, Array]]] = {}
    for pattern, elements in _rough(problem, mesh):
        jumps.setdefault(pattern, []).extend(elements.jumps())
    for pattern, found in jumps.items():
        if found:
            (x, y), sides = max(found, key=lambda jump: float(np.ptp(jump[1])))
            low, high = sorted(sides)
            warn(
                f"{pattern} jump inside {len(found)} elements, most near "
                f"({x:.4g}, {y:.4g}): a component from {low:.3g} to {high:.3g}. No order "
                "converges fast there; make the line an edge of the geometry, with a body of its "
                "own on either side"
            )
