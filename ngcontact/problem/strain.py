"""Initial strains of the bodies, as of heat or of swelling: those they take when they are free."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import ngsolve as ng
import numpy as np

from ..arrays import Mask
from .mesh_arrays import MeshArrays
from .values import SYMMETRIC, refuse_where, scalar_data

RIGHT = {
    2: "give a number, which acts in all three directions, a pair (xx, yy), a triple (xx, yy, zz), "
    "about an axis (rr, zz, hoop), or a symmetric matrix (2, 2)",
    3: "give a number, which acts in all three directions, a triple (xx, yy, zz), or a symmetric "
    "matrix (3, 3)",
}
SHAPES = {2: [(), (1,), (2,), (3,), (2, 2)], 3: [(), (1,), (3,), (3, 3)]}


# Components of an initial strain, xx, yy, the one normal to the plane, the engineering shear
# gamma_xy, and of solids gamma_yz, gamma_xz, by the places of their parts in the data of a size.
PLACES = {
    1: [[0], [0], [0], [], [], []],
    2: [[0], [1], [], [], [], []],
    3: [[0], [1], [2], [], [], []],
    4: [[0], [3], [], [1, 2], [], []],
    9: [[0], [4], [8], [1, 3], [5, 7], [2, 6]],
}


def strain_data(value: Any, what: str, dim: int) -> ng.CoefficientFunction:
    """A strain as it was given, a scalar, (2,), (3,) or a matrix, for `strain_components`."""
    right = RIGHT[dim]
    if isinstance(value, ng.CoefficientFunction):
        if tuple(value.dims) not in SHAPES[dim]:
            dims = tuple(value.dims)
            raise ValueError(f"{what} is a CoefficientFunction of dims {dims}: {right}")
        if value.is_complex:
            raise TypeError(f"{what} is a complex CoefficientFunction: it must be real")
        return value
    if not isinstance(value, Sequence | np.ndarray) or isinstance(value, str):
        return ng.CF(scalar_data(value, what))
    rows = [list(row) if isinstance(row, Sequence | np.ndarray) else [row] for row in value]
    columns = {len(row) for row in rows}
    scalars = not any(isinstance(row, Sequence | np.ndarray) for row in value)
    shape = (len(rows),) if scalars else (len(rows), *columns)
    if shape not in SHAPES[dim] or shape == (1,):
        raise ValueError(f"{what} = {value!r}: {right}")
    entries = tuple(scalar_data(entry, what) for row in rows for entry in row)
    return ng.CF(entries, dims=shape) if len(shape) == 2 else ng.CF(entries)


def strain_components(data: ng.CoefficientFunction) -> ng.CoefficientFunction:
    """Components (6,) of `strain_data`, by a product: functions are looked for once at a point."""
    size = data.dim
    parts = (float(k in places) for places in PLACES[size] for k in range(size))
    return ng.CF(tuple(parts), dims=(6, size)) * data.Reshape((size,))


def check_strains(
    view: MeshArrays,
    masks: Mapping[str, Mask],
    strains: Iterable[ng.CoefficientFunction],
    plane: Mapping[str, Mask],
    rule: ng.IntegrationRule,
) -> None:
    """Refuse strains that are not symmetric, or whose stress the law does not determine.

    A general law in the plane does not say how strains normal to it act in plane strain: `plane`
    (r,) are the masks of such laws, `masks` (r,) those of `strains`, as of `strain_data`. All
    elements are looked at at points of a `rule`.
    """
    for (label, mask), data in zip(masks.items(), strains, strict=True):
        if data.dim >= 4:
            d = int(data.dims[0])
            every = view.mesh.MapToAllElements(rule, ng.VOL)
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
