"""Checks of the region names and the data of a problem against a mesh, before any assembly.

NGSolve accepts a misspelt region silently and a NaN until the solver returns one; here both are
refused with the argument, the value and what would be right. Every test is relative or exact.
"""

from __future__ import annotations

import difflib
import itertools
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypeAlias

import ngsolve as ng
import numpy as np
from netgen.occ import OCCGeometry, TopoDS_Shape

from ..arrays import Array, Index, Mask
from .mesh_arrays import POSITION, MeshArrays, on_axis
from .values import SYMMETRIC, body_mask, boundary_mask, refuse_where

# By 'argument "pattern"': which of the r boundaries or bodies of a mesh it selects, bool (r,).
Masks: TypeAlias = dict[str, Mask]


def _rule(*points: tuple[float, float, float]) -> ng.IntegrationRule:
    return ng.IntegrationRule(list(points), [0.0] * len(points))  # weights are not read


# Where data are looked at in every element, by the dimension of the bodies. Loads are integrated
# and may be singular at an end; prescribed values and gaps are interpolated and must exist there.
ELEMENT_RULES = {
    2: _rule((1 / 6, 1 / 6, 0), (2 / 3, 1 / 6, 0), (1 / 6, 2 / 3, 0)),
    3: ng.IntegrationRule(ng.TET, 2),
}
# Middles of the sides of elements: stresses, which initial strains belong to, are compared there.
SIDE_RULES = {
    2: _rule((0.5, 0, 0), (0, 0.5, 0), (0.5, 0.5, 0)),
    3: _rule((0, 1 / 3, 1 / 3), (1 / 3, 0, 1 / 3), (1 / 3, 1 / 3, 0), (1 / 3, 1 / 3, 1 / 3)),
}
FACET_RULES = {2: ng.IntegrationRule(ng.SEGM, 3), 3: ng.IntegrationRule(ng.TRIG, 3)}
END_RULES = {
    2: _rule((0, 0, 0), (0.5, 0, 0), (1, 0, 0)),
    3: _rule((1, 0, 0), (0, 1, 0), (0, 0, 0), (1 / 3, 1 / 3, 0)),
}
# Vertices of segments and triangles, in their order, by dimension.
CORNERS = {1: _rule((1, 0, 0), (0, 0, 0)), 2: _rule((1, 0, 0), (0, 1, 0), (0, 0, 0))}
# What messages call the elements, others that are refused, and faces of bodies, by dimension.
ELEMENTS = {2: ("triangles", "quadrilaterals"), 3: ("tetrahedra", "hexahedra, prisms or pyramids")}

OVERLAP_SHARE = 0.5  # of the smaller of two bodies, from which they lie on top of each other
SAMPLE_PLACES = 200  # of a connected piece that are looked for in another one
PLANE_EXTENT = 1e-6  # extent along z of faces that lie in a plane, relative to those in it
FLATNESS = 16 * np.finfo(float).eps  # measure of an element over its longest edge^d, without height
RADIAL_ROUND_OFF = 1e-9  # radial part on the axis, relative to the largest value, that is round-off


def dimension_of(geometry: OCCGeometry | ng.Mesh) -> int:
    """The dimension of bodies; refuse solids beside plane faces, and those with a common face."""
    if isinstance(geometry, ng.Mesh):
        return int(geometry.dim)
    solids = geometry.shape.solids
    if not solids:
        x, y, z = np.ptp([tuple(v.p) for v in geometry.shape.vertices] or np.zeros((1, 3)), axis=0)
        if z > PLANE_EXTENT * max(x, y):
            raise ValueError(
                "the geometry has no solids, and its faces lie in no plane z = const: give solids "
                "with their volume, or faces in the plane z = 0"
            )
        for face in (x for x in geometry.shape.faces if x.mass < 0):  # Netgen may never return
            raise ValueError(
                f'"{face.name}" is drawn clockwise, its area is {face.mass:.6g}: turn it round'
            )
        return 2
    faces = Counter(face for solid in solids for face in solid.faces)
    if len(faces) < len(set(geometry.shape.faces)):
        raise ValueError(
            "the geometry has solids and faces that bound none of them: bodies are either solids "
            "or faces in the plane z = 0"
        )
    if any(count > 1 for count in faces.values()):
        name = next(face.name for face, count in faces.items() if count > 1)
        raise ValueError(
            f'the face "{name}" bounds two solids, so that nothing can come apart there: join '
            "bodies by Compound, not Glue"
        )
    return 3


def check_mesh(mesh: ng.Mesh, dim: int = 2) -> None:
    """Refuse anything but positively oriented, non-degenerate triangles, of solids tetrahedra."""
    if not isinstance(mesh, ng.Mesh):
        raise TypeError(f"mesh is {kind_of(mesh)}: give an ngsolve.Mesh")
    if mesh.deformation is not None:
        raise ValueError(
            "mesh has a deformation set, which would move contact and normals unseen: call "
            "mesh.UnsetDeformation() first"
        )
    if mesh.dim != dim and dim == 3:
        raise ValueError(f"mesh has dimension {mesh.dim}, and the bodies are solids")
    if mesh.dim != dim:
        raise ValueError(
            f"mesh has dimension {mesh.dim}, and bodies lie in the plane: make it with "
            "OCCGeometry(shape, dim=2), or read a file by ngcontact.mesh.read"
        )
    if mesh.ne == 0:
        raise ValueError("mesh has 0 elements: generate it first")
    for number, name in enumerate(mesh.GetMaterials()):
        if not name:
            what = "face" if dim == 2 else "solid"
            raise ValueError(f'material region {number} has the name "": give every {what} a name')
    view = MeshArrays(mesh)
    if others := view.without_simplices():
        right = "it must be a triangulation" if dim == 2 else "it must consist of tetrahedra"
        raise ValueError(f"mesh has {others} {ELEMENTS[dim][1]}: {right}")
    size = view.measures
    bad = ~(size > FLATNESS * view.diameters**dim)  # so a NaN is bad
    if bad.any():
        first = int(np.argmax(bad))
        what, order = ("area", " (vertices counterclockwise)") if dim == 2 else ("volume", "")
        raise ValueError(
            f"mesh has {np.count_nonzero(bad)} inverted or degenerate {ELEMENTS[dim][0]}: number "
            f"{first} with the vertices {view.corners[first].tolist()} has the signed {what} "
            f"{size[first]:.3g}, which must be positive{order}"
        )
    if (
        dim == 3
        and mesh.GetCurveOrder() > 1
        and not isinstance(mesh.ngmesh.GetGeometry(), OCCGeometry)
    ):
        raise ValueError(
            "the mesh is curved without a geometry, and normals of its facets are none of the "
            "body's: give the OCC geometry, or a mesh of first order"
        )


def check_numbers(view: MeshArrays) -> None:
    """Refuse vertices of no element, facets that occur twice, outer sides that are no facets."""
    unused = np.bincount(view.elements.ravel(), minlength=len(view.vertices)) == 0
    if unused.any():
        first = int(np.argmax(unused))
        raise ValueError(
            f"mesh has {np.count_nonzero(unused)} vertices of no element: number {first} at "
            f"{view.vertices[first].tolist()}; leave them out, as ngmesh.Compress() does, and give "
            "elements of first order, without middles of edges"
        )
    _, first_facet, count = np.unique(view.keys(view.facets), return_index=True, return_counts=True)
    if (count > 1).any():
        corners = view.vertices[view.facets[first_facet[np.argmax(count > 1)]]].tolist()
        raise ValueError(
            f"{np.count_nonzero(count > 1)} sides of elements occur twice in the boundaries of the "
            f"mesh, one with the vertices {corners}: what acts there would count twice; give every "
            "side one name"
        )
    outer = np.count_nonzero(np.unique(view.keys(view.sides), return_counts=True)[1] == 1)
    if outer != (named := np.count_nonzero(~view.inner_facets)):
        raise ValueError(
            f"the boundaries of the mesh have {named} of its {outer} outer sides, and estimates "
            "see no others: give these a name, and no others, as ngcontact.mesh.read does"
        )


def kind_of(value: Any) -> str:
    """Kind of a value that should be a mesh or a geometry."""
    kind = type(value)
    if kind.__module__.startswith("netgen") and kind.__name__ == "Mesh":
        return "a raw Netgen mesh, which ngsolve.Mesh(mesh) wraps"
    if isinstance(value, TopoDS_Shape):
        return f"a {kind.__name__}, which OCCGeometry(shape, dim=2) wraps, dim=3 for solids"
    article = "an" if kind.__name__[0] in "aeiouAEIOU" else "a"
    return f"{article} {kind.__name__}"


def regions_of(
    mesh: ng.Mesh,
    argument: str,
    patterns: Iterable[str],
    mask_of: Callable[[ng.Mesh, str], Mask],
) -> Masks:
    """Return the mask (r,) of every pattern: each selects something, and no region twice."""
    names = mesh.GetMaterials() if mask_of is body_mask else mesh.GetBoundaries()
    masks: Masks = {}
    for pattern in patterns:
        # NGSolve drops the misspelt half of "left|rigth" without a word, so look at each half.
        mask = mask_of(mesh, pattern)
        single = "|" not in pattern or set(pattern) & set("()[]{}\\")
        for part in [pattern] if single else pattern.split("|"):
            if not (mask if single else mask_of(mesh, part)).any():
                known = sorted(set(names))
                close = difflib.get_close_matches(part, known, n=1)
                hint = f'did you mean "{close[0]}"? ' if close else ""
                if mask_of is body_mask and part in mesh.GetBoundaries():
                    hint = "it is a boundary, and bodies are asked for; "
                if mask_of is boundary_mask and part in mesh.GetMaterials():
                    hint = "it is a body, and boundaries are asked for; "
                raise ValueError(f'{argument} "{part}" selects no region; {hint}there are {known}')
        label = f'{argument} "{pattern}"'
        refuse_common(names, masks, {label: mask}, "give every region once")
        masks[label] = mask
    return masks


def refuse_common(names: Sequence[str], one: Masks, other: Masks, right: str) -> None:
    """Refuse a region, of the names (r,), that the masks (r,) of two arguments have in common."""
    for (a, first), (b, second) in itertools.product(one.items(), other.items()):
        common = sorted({n for n, both in zip(names, first & second, strict=True) if both})
        if common:
            raise ValueError(f'"{"|".join(common)}" is both in {a} and in {b}: {right}')


def check_pairs(view: MeshArrays, contact: Sequence[Masks], inner: Mask) -> None:
    """Refuse contact inside a body: on an interface, of a curve with itself, of a body with itself.

    A body is a connected piece of the mesh, whatever the names of its parts. `contact` are the
    masks (r,) of the sides of each pair, `inner` (r,) boundaries between two triangles.
    """
    names, region, ends = view.mesh.GetBoundaries(), view.boundaries, view.facets
    for sides in contact:
        right = "it lies inside one body; join bodies by Compound, not Glue"
        refuse_common(names, sides, {"the interfaces of the mesh": inner}, right)
        for (a, first), (b, second) in itertools.combinations(sides.items(), 2):
            refuse_common(names, {a: first}, {b: second}, "name two different boundaries")
            if set(view.pieces[ends[first[region]]].flat) & set(
                view.pieces[ends[second[region]]].flat
            ):
                raise ValueError(
                    f"{a} and {b} lie on the same body: contact is between two bodies without a "
                    "common mesh vertex (join them by Compound, not Glue)"
                )


def check_tractions(
    names: Sequence[str],
    traction: Masks,
    loads: Iterable[ng.CoefficientFunction],
    inner: Mask,
    shared: Mask,
) -> None:
    """Refuse tractions, one for each mask (r,), on lines that no single body bounds.

    Pressures on boundaries between two triangles, `inner` (r,), which have two normals; and any
    traction on those that are `shared` (r,) by two bodies.
    """
    for (label, mask), load in zip(traction.items(), loads, strict=True):
        if load.dim == 1 and (mask & inner).any():
            raise ValueError(
                f'{label} is a pressure, and "{names[int(np.argmax(mask & inner))]}" lies inside a '
                "body or between two that are glued, where no normal is the outward one: give a "
                "vector as traction; if it should bound a cut, draw what is cut off anticlockwise, "
                "as OCC needs it"
            )
        if (mask & shared).any():
            raise ValueError(
                f'{label}: the edge "{names[int(np.argmax(mask & shared))]}" is shared by two '
                "bodies, and no traction acts on one of them alone there: give the edges of their "
                "own boundary names of their own, or join the bodies by Compound, not Glue"
            )


def check_overlaps(view: MeshArrays) -> None:
    """Refuse bodies drawn on top of each other, and a face drawn over a part of itself."""
    piece = view.pieces[view.elements[:, 0]]
    parts = [np.flatnonzero(piece == k) for k in range(piece.max(initial=0) + 1)]
    if len(parts) == 1:
        return
    area = view.measures
    size = np.array([area[part].sum() for part in parts])
    points = [view.vertices[view.pieces == k] for k in range(len(parts))]
    box = np.array([[x.min(axis=0), x.max(axis=0)] for x in points])
    for small, large in itertools.combinations(np.argsort(size, kind="stable").tolist(), 2):
        width = np.minimum(box[small, 1], box[large, 1]) - np.maximum(box[small, 0], box[large, 0])
        if min(width) <= 0 or width.prod() <= OVERLAP_SHARE * size[small]:
            continue
        upto = np.cumsum(area[parts[small]])
        at = np.searchsorted(upto, (np.arange(SAMPLE_PLACES) + 0.5) / SAMPLE_PLACES * upto[-1])
        middle = view.corners[parts[small][at]].mean(axis=1)
        share = float(_inside(middle, view, parts[large]).mean())
        if share > OVERLAP_SHARE:
            names = view.mesh.GetMaterials()
            name, beside = (names[view.bodies[parts[k][0]]] for k in (small, large))
            what = ("area", "volume")[view.dim - 2]
            raise ValueError(
                f'body "{name}" of {what} {size[small]:.4g} and body "{beside}" of {what} '
                f"{size[large]:.4g} lie on top of each other, about {share * size[small]:.2g} of "
                f"{what}: cut one out of the other (outer - inner) or draw them "
                "side by side"
            )


def _inside(points: Array, view: MeshArrays, part: Index) -> Mask:
    """Mask (k,) of the `points` (k, d) in the elements `part` (n,) of a mesh."""
    point, element = view.near(points)
    corners = view.corners[element]
    edges = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
    at = np.linalg.solve(edges, (points[point] - corners[:, 0])[..., None])[..., 0]
    inside = (at >= 0).all(axis=1) & (at.sum(axis=1) <= 1) & np.isin(element, part)
    return np.isin(np.arange(len(points)), point[inside])


def check_values(
    view: MeshArrays, masks: Masks, data: Iterable[Any], rule: Mapping[int, ng.IntegrationRule]
) -> None:
    """Refuse data, one for each mask (r,), that are not finite, or laws that are not elliptic.

    A law, a number, a function of a mesh point or of coordinates, or a tuple of these and None,
    looked at in the selected elements at points of a rule, by dimension, `ELEMENT_RULES` or
    `SIDE_RULES` for bodies.
    """
    of_bodies = rule is ELEMENT_RULES or rule is SIDE_RULES
    vb, region = (ng.VOL, view.bodies) if of_bodies else (ng.BND, view.boundaries)
    if not masks:
        return
    everywhere = view.mesh.MapToAllElements(rule[view.dim], vb)
    for (label, mask), value in zip(masks.items(), data, strict=True):
        points = np.asarray(everywhere[mask[region][everywhere["nr"]]])
        if hasattr(value, "check_at"):
            value.check_at(points, label)  # (2.7)
            continue
        for part in value if isinstance(value, tuple) else (value,):
            if part is None:
                continue
            if callable(part) and not isinstance(part, ng.CoefficientFunction):
                values = _of_coordinates(points, part, label, view.dim)
            else:
                values = ng.CF(part)(points).reshape(len(points), -1)
            bad = ~np.isfinite(values.reshape(len(points), -1))
            refuse_where(points, np.asarray(bad.any(axis=1)), values, label, "must be finite")


def _of_coordinates(points: Array, gap: Callable[..., Any], label: str, dim: int) -> Array:
    """Values (k,) of a function of coordinates at mesh `points` (k,), refused if no number each."""
    x = POSITION(points).T[:dim].copy()
    names, count = (("x, y", "two"), ("x, y, z", "three"))[dim - 2]
    try:
        values = np.asarray(gap(*x))
    except Exception as error:
        kind = TypeError if isinstance(error, TypeError) else ValueError
        raise kind(
            f"{label} failed on arrays {names} of shape {x[0].shape} ({error}): it must take "
            f"{count} arrays and return one, with np.where(x > 0, a, b) in place of a if x > 0 "
            "else b"
        ) from error
    if values.dtype.kind not in "iuf":
        raise TypeError(f"{label} returns values of type {values.dtype}: return real numbers")
    if values.shape != x[0].shape:
        raise ValueError(
            f"{label} returns shape {values.shape} for coordinates of shape {x[0].shape}: "
            "return one value per point"
        )
    return values


def check_strains(
    view: MeshArrays,
    masks: Masks,
    strains: Iterable[ng.CoefficientFunction],
    plane: Masks,
) -> None:
    """Refuse strains that are not symmetric, or whose stress the law does not determine.

    A general law in the plane does not say how strains normal to it act in plane strain: `plane`
    (r,) are the masks of such laws, `masks` (r,) those of `strains`, as of `strain_data`.
    """
    for (label, mask), data in zip(masks.items(), strains, strict=True):
        if data.dim >= 4:
            d = int(data.dims[0])
            every = view.mesh.MapToAllElements(ELEMENT_RULES[view.dim], ng.VOL)
            points = every[mask[view.bodies][every["nr"]]]
            values = data(points).reshape(-1, d, d)
            skew = np.abs(values - values.transpose(0, 2, 1)).max(axis=(1, 2))
            bad = skew > SYMMETRIC * np.abs(values).max(initial=0.0)
            refuse_where(points, bad, data(points), label, "a strain is symmetric, xy = yx")
        for body, where in plane.items() if data.dim in (1, 3) else ():
            if (mask & where).any():
                raise ValueError(
                    f"{label} has a part normal to the plane, and the 3x3 law of {body} does not "
                    "tell what that does in plane strain: give the pair (xx, yy) of strains in the "
                    "plane that leave it without stress"
                )


def check_about_axis(
    view: MeshArrays,
    displacement: Mapping[str, Any],
    traction: Mapping[str, Any],
    force: Mapping[str, Any],
    sides: Iterable[str],
    strain: Mapping[str, Any],
) -> None:
    """Refuse a body across the axis, conditions on the axis, and data that point sideways there.

    A vector with a radial part on the axis is no field of revolution: what pushes a body sideways
    is not axisymmetric. Nor is a strain that is not alike in all directions across the axis.
    """
    mesh, axis = view.mesh, on_axis(view.vertices)
    first = int(np.argmin(view.vertices[:, 0]))
    x, y = view.vertices[first]
    if x < 0 and not axis[first]:
        raise ValueError(
            f"the mesh reaches to x = {x:.6g} at y = {y:.6g}, across the axis x = 0: "
            "an axisymmetric body is given by its half with x >= 0"
        )
    other, free = "name a boundary with x > 0", "leave the second component free by None"
    acting = [("contact", side, other) for side in sides]
    acting += [("traction", name, other) for name in traction]
    acting += [("displacement", k, free) for k, u in displacement.items() if u[1] is not None]
    for what, name, right in acting:
        if axis[view.facets[boundary_mask(mesh, name)[view.boundaries]]].all(axis=1).any():
            raise ValueError(f'{what} "{name}" is on the axis x = 0, which has no area: {right}')
    radials = [("traction", name, p[0]) for name, p in traction.items() if p.dim == 2]
    radials += [("displacement", k, u[0]) for k, u in displacement.items() if u[0] is not None]
    radials += [("force", name, F[0]) for name, F in force.items()]
    for name, e in strain.items():
        sizes = e[0], e[2]
        radials += [("strain", name, ng.CF((x, *sizes))) for x in (e[0] - e[2], e[3] / 2)]
    for what, name, radial in radials:
        if what in ("force", "strain"):
            at, ends, vb = body_mask(mesh, name)[view.bodies], view.elements, ng.VOL
        else:
            at, ends, vb = boundary_mask(mesh, name)[view.boundaries], view.facets, ng.BND
        points = mesh.MapToAllElements(CORNERS[ends.shape[1] - 1], vb)
        found = np.asarray(radial(points[np.repeat(at, ends.shape[1])])).reshape(-1, radial.dim)
        size, values = np.abs(found[np.isfinite(found)]).max(initial=0.0), found[:, 0]
        bad = axis[ends[at]].ravel() & (np.abs(values) > RADIAL_ROUND_OFF * size)
        if bad.any():
            part = "rr - hoop or rz =" if what == "strain" else "the radial component"
            raise ValueError(
                f'{what} "{name}" has {part} {values[np.argmax(bad)]:.6g} on the '
                "axis x = 0, sideways: it must vanish there, as around the axis every direction is "
                "radial"
            )
