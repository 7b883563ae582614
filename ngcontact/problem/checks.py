"""Checks of the region names and the data of a problem against a mesh, before any assembly.

NGSolve accepts a misspelt region silently and a NaN until the solver returns one; here both are
refused with the argument, the value and what would be right. Every test is relative or exact.
"""

from __future__ import annotations

import difflib
import itertools
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

import ngsolve as ng
import numpy as np

from .regions import body_mask, body_of_vertex, boundary_mask, vertex_numbers
from .values import refuse_where

if TYPE_CHECKING:
    from .contact import Contact
    from .problem import Problem


Masks = dict[str, np.ndarray]  # by 'argument "pattern"': which region numbers it selects

# Loads are integrated and may be singular at an end; prescribed values and gaps are interpolated
# and must exist there.
_INNER = ng.IntegrationRule(ng.SEGM, 3)
_ENDS = ng.IntegrationRule([(0, 0, 0), (0.5, 0, 0), (1, 0, 0)], [1 / 6, 2 / 3, 1 / 6])
_BULK = ng.IntegrationRule([(1 / 6, 1 / 6, 0), (2 / 3, 1 / 6, 0), (1 / 6, 2 / 3, 0)], [1 / 6] * 3)
_TRIANGLES = (10, 12)  # netgen's element types TRIG and TRIG6
_FLAT = 16 * np.finfo(float).eps


def check_problem(problem: Problem, mesh: ng.Mesh) -> None:
    """Refuse a problem whose names or values do not fit the mesh.

    Raises
    ------
    TypeError
        If `mesh` is not an `ngsolve.Mesh`, or a gap function does not return numbers.
    ValueError
        If the mesh is no valid plane triangulation, a name selects nothing, two conditions meet
        on one boundary, a contact pair is impossible, or data are not finite or not elliptic.
    """
    check_mesh(mesh)
    names = mesh.GetBoundaries()
    materials = regions_of(mesh, "materials", problem.materials, body_mask)
    force = regions_of(mesh, "force", problem.force, body_mask)
    displacement = regions_of(mesh, "displacement", problem.displacement, boundary_mask)
    traction = regions_of(mesh, "traction", problem.traction, boundary_mask)
    slides = [problem.sliding] if isinstance(problem.sliding, str) else []
    sliding = regions_of(mesh, "sliding", slides, boundary_mask)
    contact = [sides_of(mesh, f"contact[{j}]", pair) for j, pair in enumerate(problem.contact)]

    _check_bodies(mesh, materials)
    _refuse_common(names, sliding, displacement, "keep one of the two")
    _refuse_common(names, traction, sliding, "keep one of the two")
    prescribed = zip(displacement.items(), problem.displacement.values(), strict=True)
    full = {label: mask for (label, mask), (ux, uy) in prescribed if not (ux is None or uy is None)}
    _refuse_common(names, traction, full, "keep one, or leave a component free by None")
    for sides in contact:
        others = displacement | traction | sliding
        _refuse_common(names, sides, others, "a contact boundary takes no other condition")
    _check_pairs(mesh, contact)

    for (label, mask), law in zip(materials.items(), problem.materials.values(), strict=True):
        law.check_at(_points(mesh, ng.VOL, mask, _BULK), label)
    for masks, given, vb, rule in [
        (force, problem.force, ng.VOL, _BULK),
        (traction, problem.traction, ng.BND, _INNER),
        (displacement, problem.displacement, ng.BND, _ENDS),
    ]:
        for (label, mask), data in zip(masks.items(), given.values(), strict=True):
            _check_finite(_points(mesh, vb, mask, rule), data, label)
    for j, (sides, pair) in enumerate(zip(contact, problem.contact, strict=True)):
        if pair.gap is not None:
            points = _points(mesh, ng.BND, next(iter(sides.values())), _ENDS)
            _check_gap(points, pair.gap, f"contact[{j}].gap")


def check_mesh(mesh: ng.Mesh) -> None:
    """Refuse anything but a plane mesh of positively oriented, non-degenerate triangles."""
    if not isinstance(mesh, ng.Mesh):
        raise TypeError(f"mesh is a {type(mesh).__name__}: give an ngsolve.Mesh")
    if mesh.dim != 2:
        raise ValueError(f"mesh has dimension {mesh.dim}: make it with OCCGeometry(shape, dim=2)")
    if mesh.ne == 0:
        raise ValueError("mesh has 0 elements: generate it first")
    elements = mesh.ngmesh.Elements2D()
    others = np.count_nonzero(~np.isin(elements.NumPy()["type"], _TRIANGLES))
    if others:
        raise ValueError(f"mesh has {others} quadrilaterals: it must be a triangulation")
    vertex = np.asarray(mesh.ngmesh.Coordinates())[:, :2][vertex_numbers(elements, 3)]
    edge = np.roll(vertex, -1, axis=1) - vertex
    area = (edge[:, 0, 0] * edge[:, 1, 1] - edge[:, 0, 1] * edge[:, 1, 0]) / 2
    longest = np.square(edge).sum(axis=2).max(axis=1)
    bad = ~(area > _FLAT * longest)  # so a NaN is bad
    if bad.any():
        first = int(np.argmax(bad))
        raise ValueError(
            f"mesh has {np.count_nonzero(bad)} inverted or degenerate triangles: number {first} "
            f"with the vertices {vertex[first].tolist()} has the signed area {area[first]:.3g}, "
            "which must be positive (vertices counterclockwise)"
        )


def regions_of(
    mesh: ng.Mesh,
    argument: str,
    patterns: Iterable[str],
    mask_of: Callable[[ng.Mesh, str], np.ndarray],
) -> Masks:
    """Return the mask of every pattern; each selects something, and no region is given twice."""
    names = mesh.GetMaterials() if mask_of is body_mask else mesh.GetBoundaries()
    masks: Masks = {}
    for pattern in patterns:
        # NGSolve drops the misspelt half of "left|rigth" without a word, so look at each half.
        for part in [pattern] if set(pattern) & set("()[]{}\\") else pattern.split("|"):
            if not mask_of(mesh, part).any():
                known = sorted(set(names))
                close = difflib.get_close_matches(part, known, n=1)
                hint = f'did you mean "{close[0]}"? ' if close else ""
                raise ValueError(f'{argument} "{part}" selects no region; {hint}there are {known}')
        label = f'{argument} "{pattern}"'
        mask = {label: mask_of(mesh, pattern)}
        _refuse_common(names, masks, mask, "give every region once")
        masks |= mask
    return masks


def sides_of(mesh: ng.Mesh, argument: str, pair: Contact) -> Masks:
    """Return the masks of the sides of a contact pair, the secondary first."""
    sides = regions_of(mesh, f"{argument}.secondary", [pair.secondary], boundary_mask)
    if pair.primary is not None:
        sides |= regions_of(mesh, f"{argument}.primary", [pair.primary], boundary_mask)
    return sides


def _refuse_common(names: Sequence[str], one: Masks, other: Masks, right: str) -> None:
    """Refuse a region that two arguments have in common."""
    for (a, first), (b, second) in itertools.product(one.items(), other.items()):
        common = sorted({n for n, both in zip(names, first & second, strict=True) if both})
        if common:
            raise ValueError(f'"{"|".join(common)}" is both in {a} and in {b}: {right}')


def _check_bodies(mesh: ng.Mesh, materials: Masks) -> None:
    """Refuse bodies without a name or without a material."""
    covered = np.logical_or.reduce(list(materials.values()))
    for number, name in enumerate(mesh.GetMaterials()):
        if not name:
            raise ValueError(f'material region {number} has the name "": give every face a name')
        if not covered[number]:
            raise ValueError(f'body "{name}" has no material: add materials["{name}"]')


def _check_pairs(mesh: ng.Mesh, contact: Sequence[Masks]) -> None:
    """Refuse contact inside a body: on an interface, of a curve with itself, of a body with itself.

    A body is a connected piece of the mesh, whatever the names of its parts.
    """
    if not contact:
        return
    names = mesh.GetBoundaries()
    region = mesh.ngmesh.Elements1D().NumPy()["index"] - 1
    ends = vertex_numbers(mesh.ngmesh.Elements1D(), 2)
    body = body_of_vertex(mesh)
    inner = np.bincount(region[_has_two_sides(mesh, ends)], minlength=len(names)) > 0
    for sides in contact:
        right = "it lies inside one body; join bodies by Compound, not Glue"
        _refuse_common(names, sides, {"the interfaces of the mesh": inner}, right)
        for (a, first), (b, second) in itertools.combinations(sides.items(), 2):
            _refuse_common(names, {a: first}, {b: second}, "name two different boundaries")
            if np.intersect1d(body[ends[first[region]]], body[ends[second[region]]]).size:
                raise ValueError(
                    f"{a} and {b} lie on the same body: contact is between two bodies without a "
                    "common mesh vertex (join them by Compound, not Glue)"
                )


def _has_two_sides(mesh: ng.Mesh, ends: np.ndarray) -> np.ndarray:
    """Return which segments, given by vertices (n, 2), lie between two triangles, bool (n,)."""
    size = len(mesh.ngmesh.Coordinates())
    marked = np.zeros(size, dtype=bool)
    marked[ends] = True
    edges = vertex_numbers(mesh.ngmesh.Elements2D(), 3)[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    edges = np.sort(edges[marked[edges].all(axis=1)], axis=1)
    keys, count = np.unique(edges[:, 0] * np.int64(size) + edges[:, 1], return_counts=True)
    ends = np.sort(ends, axis=1)
    return np.isin(ends[:, 0] * np.int64(size) + ends[:, 1], keys[count > 1])


def _points(mesh: ng.Mesh, vb: ng.VorB, mask: np.ndarray, rule: ng.IntegrationRule) -> np.ndarray:
    """Return NGSolve's mesh points of a rule on every element of the selected regions."""
    elements = mesh.ngmesh.Elements2D() if vb == ng.VOL else mesh.ngmesh.Elements1D()
    points = mesh.MapToAllElements(rule, vb)
    return points[mask[elements.NumPy()["index"] - 1][points["nr"]]]


def _check_finite(points: np.ndarray, data: Any, label: str) -> None:
    """Refuse a CoefficientFunction, or a tuple of them and None, that is not finite somewhere."""
    for part in data if isinstance(data, tuple) else (data,):
        if part is not None:
            values = part(points).reshape(len(points), -1)
            refuse_where(points, ~np.isfinite(values).all(axis=1), values, label, "must be finite")


def _check_gap(points: np.ndarray, gap: Any, label: str) -> None:
    """Refuse a gap that is not finite somewhere; a function must return one number per point."""
    if not callable(gap) or isinstance(gap, ng.CoefficientFunction):
        _check_finite(points, ng.CF(gap), label)
        return
    x, y = ng.CF((ng.x, ng.y))(points).T.copy()
    values = np.asarray(gap(x, y))
    if values.dtype.kind not in "iuf":
        raise TypeError(f"{label} returns values of type {values.dtype}: return real numbers")
    if values.shape != x.shape:
        raise ValueError(
            f"{label} returns shape {values.shape} for x and y of shape {x.shape}: "
            "return one value per point"
        )
    refuse_where(points, ~np.isfinite(values), values, label, "must be finite")
