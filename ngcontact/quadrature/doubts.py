"""Data that may not be what was meant, or are narrower than the mesh."""

from __future__ import annotations

from dataclasses import dataclass

import ngsolve as ng
import numpy as np

from ..arrays import Array, Index, Mask
from ..errors import warn
from ..problem import Problem
from .features import Features, features_of, touched
from .loads import known_rough_load, moment_degree
from .view import View, numbers

LOST = 1e-3  # of a load that quadrature may miss without a word
# Size of an element over the width of a feature in it, up to which it is resolved. Loads are
# integrated on parts of elements, but stresses in equilibrium meet body forces on so many of them.
RESOLVED = {"displacement": 2.0, "gap": 2.0, "materials": 2.0}
IN_BOUNDS = RESOLVED | {"force": 32.0, "traction": 2.0}  # the last one on curves
BENT = 1e-9  # of a segment, its distance from a chord


def warn_of_data(problem: Problem, mesh: ng.Mesh, order: int) -> None:
    """Warn of loads that vanish wherever they are looked at or are finer than any quadrature."""
    for one in features_of(problem, mesh):
        if one.kind in ("force", "traction") and one.samples and not one.largest:
            warn(
                f'{one.kind} "{one.name}" is zero at all {one.samples} points at which it was '
                "looked at: if it acts on a smaller part, make that a boundary or a body of its own"
            )
    loads = [
        ("force", k, F, F, mesh.Materials(k)) for k, F in problem.force.items() if not numbers(F)
    ]
    for k, p in problem.traction.items():
        if not numbers(p):
            loads.append(("traction", k, p, problem.traction_vector(k), mesh.Boundaries(k)))
    for kind, name, data, load, region in loads:
        found = known_rough_load(data, load, region, moment_degree(order))
        if found is not None and found.missed.sum() > LOST * found.total:
            warn(
                f'{kind} "{name}" is finer than any quadrature: up to '
                f"{found.missed.sum() / found.total:.1%} of it may be missed; give a smoother load"
            )


@dataclass(frozen=True, eq=False)
class Unresolved:
    """A function with features that are narrower than the elements they lie in.

    Attributes
    ----------
    kind, name : str
        As of `Features`.
    place : ndarray (2,)
        Of the feature that is narrowest beside its element, lengths.
    width, size : float
        Of this feature and its element, lengths.
    elements : ndarray of bool (ne,)
        All triangles that are too large.
    """

    kind: str
    name: str
    place: Array
    width: float
    size: float
    elements: Mask

    def __str__(self) -> str:
        """What is told of it."""
        x, y = self.place
        return (
            f'{self.kind} "{self.name}" has a feature {self.width:.2g} wide near '
            f"({x:.4g}, {y:.4g}), in an element of size {self.size:.2g}"
        )


def unresolved(problem: Problem, mesh: ng.Mesh, *, in_bounds: bool = False) -> list[Unresolved]:
    """Functions whose features are narrower than a mesh shows, or `in_bounds` of the error."""
    limits, found = IN_BOUNDS if in_bounds else RESOLVED, []
    for one in features_of(problem, mesh):
        if one.kind not in limits or not len(one.places):
            continue
        view = View(mesh, one.dim)
        at, feature = _met(one, view)
        ratio = view.sizes[at] / one.widths[feature]
        large = ratio > limits[one.kind]
        if one.kind == "traction":
            large &= _bent(view, at)
        if large.any():
            worst = int(np.argmax(np.where(large, ratio, 0.0)))
            k = feature[worst]
            place, width, size = one.places[k], one.widths[k], view.sizes[at[worst]]
            mask = _triangles(view, at[large])
            found.append(Unresolved(one.kind, one.name, place, width, size, mask))
    return found


def _met(features: Features, view: View) -> tuple[Index, Index]:
    """Elements (k,) in which features lie, and numbers (k,) of these."""
    x, mesh = features.places, view.mesh
    every = np.arange(len(x))
    if view.dim == 2:
        at = mesh(x[:, 0].copy(), x[:, 1].copy())["nr"].astype(np.intp)
        return at[at >= 0], every[at >= 0]
    region = mesh.Boundaries(features.name)
    return touched(np.column_stack([x, features.widths]), view, view.inside(region))


def _bent(view: View, segments: Index) -> Mask:
    """Which `segments` (k,) are curved, (k,)."""
    middle = view.evaluate(ng.CF((ng.x, ng.y)), segments, np.array([[0.5]]))[:, 0]
    chord = view.arrays.vertices[view.arrays.facets[segments]].mean(axis=1)
    return np.asarray(np.linalg.norm(middle - chord, axis=1) > BENT * view.sizes[segments])


def _triangles(view: View, elements: Index) -> Mask:
    """Mask (ne,) of triangles `elements` (k,), or of those at such segments."""
    if view.dim == 2:
        return np.bincount(elements, minlength=view.mesh.ne) > 0
    triangles = view.arrays.elements
    ends = np.isin(triangles, view.arrays.facets[elements])
    return np.asarray(ends.sum(axis=1) > 1)


def warn_of_unresolved(problem: Problem, mesh: ng.Mesh) -> None:
    """Warn of functions with features that a mesh does not show."""
    for one in unresolved(problem, mesh):
        warn(f"{one}: the solution hardly knows of it; refine the mesh there, or take `adapt`")
