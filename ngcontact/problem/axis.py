"""Bodies of revolution about x = 0: what a mesh and data must be at their axis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import ngsolve as ng
import numpy as np

from ..arrays import Array, Mask
from .contact import Contact
from .mesh_arrays import MeshArrays
from .values import body_mask, boundary_mask

ON_AXIS = 1e-9  # radius, relative to the largest, up to which a point lies on the axis
NO_RADIAL = 1e-9  # radial part there, relative to the largest value, that is round-off

CORNERS = ng.IntegrationRule([(1, 0, 0), (0, 1, 0), (0, 0, 0)], [1 / 6] * 3)
ENDS = ng.IntegrationRule([(1, 0, 0), (0, 0, 0)], [1 / 2] * 2)


def on_axis(points: Array) -> Mask:
    """Which of `points` (k, 2), those of a mesh or of its whole boundary, have r = 0, (k,)."""
    r = np.abs(points[:, 0])
    return np.asarray(r <= ON_AXIS * r.max(initial=0.0))


def check_about_axis(
    mesh: ng.Mesh,
    displacement: Mapping[str, Sequence[ng.CoefficientFunction | None]],
    traction: Mapping[str, ng.CoefficientFunction],
    force: Mapping[str, ng.CoefficientFunction],
    contact: Sequence[Contact],
) -> None:
    """Refuse a body across the axis, conditions on the axis, and data that point sideways there.

    A vector with a radial part on the axis is no field of revolution: what pushes a body sideways
    is not axisymmetric. The data are those of a `Problem`.
    """
    view = MeshArrays(mesh)
    _check_side(view.vertices)
    axis = on_axis(view.vertices)
    along: Mask = np.asarray(axis[view.facets].all(axis=1))

    def refuse_along(what: str, pattern: str, right: str) -> None:
        if along[boundary_mask(mesh, pattern)[view.boundaries]].any():
            raise ValueError(f'{what} "{pattern}" is on the axis x = 0, which has no area: {right}')

    for pair in contact:
        for pattern in (pair.secondary, pair.primary):
            if pattern is not None:
                refuse_along("contact", pattern, "name a boundary with x > 0")
    vectors: list[tuple[str, str, Any, bool]] = []
    for pattern, load in traction.items():
        refuse_along("traction", pattern, "name a boundary with x > 0")
        if load.dim == 2:
            vectors.append(("traction", pattern, load[0], False))
    for pattern, (radial, axial) in displacement.items():
        if axial is not None:
            refuse_along("displacement", pattern, "leave the second component free by None")
        if radial is not None:
            vectors.append(("displacement", pattern, radial, False))
    vectors += [("force", pattern, load[0], True) for pattern, load in force.items()]
    for what, pattern, radial, inside in vectors:
        if inside:
            at, vertex = body_mask(mesh, pattern)[view.bodies], view.elements
            points = mesh.MapToAllElements(CORNERS, ng.VOL)
        else:
            at, vertex = boundary_mask(mesh, pattern)[view.boundaries], view.facets
            points = mesh.MapToAllElements(ENDS, ng.BND)
        values = np.asarray(radial(points[np.repeat(at, vertex.shape[1])])).ravel()
        _check_radial(f'{what} "{pattern}"', values, axis[vertex[at]].ravel())


def _check_side(vertices: Array) -> None:
    """Refuse vertices (nv, 2) with x < 0."""
    least = vertices[np.argmin(vertices[:, 0])]
    if least[0] < 0 and not on_axis(vertices)[np.argmin(vertices[:, 0])]:
        raise ValueError(
            f"the mesh reaches to x = {least[0]:.6g} at y = {least[1]:.6g}, across the axis x = 0: "
            "an axisymmetric body is given by its half with x >= 0"
        )


def _check_radial(label: str, values: Array, axis: Mask) -> None:
    """Refuse radial parts (k,), some of them on the `axis` (k,), that do not vanish there."""
    size = np.abs(values[np.isfinite(values)]).max(initial=0.0)
    bad = axis & (np.abs(values) > NO_RADIAL * size)
    if bad.any():
        value = values[np.argmax(bad)]
        raise ValueError(
            f"{label} has the radial component {value:.6g} on the axis x = 0, sideways: it must "
            "vanish there, as around the axis every direction is radial"
        )
