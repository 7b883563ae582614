"""Initial strains of the bodies, as of heat or of swelling: those they take when they are free."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import ngsolve as ng
import numpy as np

from ..arrays import Mask
from .mesh_arrays import MeshArrays
from .values import SYMMETRIC, refuse_where, scalar_data

RIGHT = (
    "give a number, which acts in all three directions, a pair (xx, yy), a triple (xx, yy, zz), "
    "about an axis (rr, zz, hoop), or a symmetric matrix (2, 2)"
)


class InitialStrain(NamedTuple):
    """Components of an initial strain e0, scalars; about an axis rr, zz, the hoop's, rz."""

    xx: ng.CoefficientFunction
    yy: ng.CoefficientFunction
    normal: ng.CoefficientFunction  # to the plane
    shear: ng.CoefficientFunction  # the engineering one, gamma_xy


def strain_data(value: Any, what: str) -> ng.CoefficientFunction:
    """Return a strain as it was given: a scalar, (2,), (3,) or (2, 2); `components` reads it."""
    if isinstance(value, ng.CoefficientFunction):
        if tuple(value.dims) not in ((), (1,), (2,), (3,), (2, 2)):
            dims = tuple(value.dims)
            raise ValueError(f"{what} is a CoefficientFunction of dims {dims}: {RIGHT}")
        if value.is_complex:
            raise TypeError(f"{what} is a complex CoefficientFunction: it must be real")
        return value
    if not isinstance(value, Sequence | np.ndarray) or isinstance(value, str):
        return ng.CF(scalar_data(value, what))
    rows = [list(row) if isinstance(row, Sequence | np.ndarray) else [row] for row in value]
    if [len(row) for row in rows] not in ([1, 1], [1, 1, 1], [2, 2]):
        raise ValueError(f"{what} = {value!r}: {RIGHT}")
    entries = tuple(scalar_data(entry, what) for row in rows for entry in row)
    return ng.CF(entries, dims=(2, 2)) if len(entries) == 4 else ng.CF(entries)


def components(data: ng.CoefficientFunction) -> InitialStrain:
    """The components of what `strain_data` returned."""
    zero = ng.CF(0.0)
    if data.dim == 1:
        return InitialStrain(data, data, data, zero)
    if data.dim == 4:
        return InitialStrain(data[0, 0], data[1, 1], zero, data[0, 1] + data[1, 0])
    return InitialStrain(data[0], data[1], data[2] if data.dim == 3 else zero, zero)


def check_strains(
    view: MeshArrays,
    masks: Mapping[str, Mask],
    strains: Iterable[ng.CoefficientFunction],
    plane: Mapping[str, Mask],
    rule: ng.IntegrationRule,
) -> None:
    """Refuse strains that are not symmetric, or of which a law does not tell what they do.

    A general law in the plane does not say how strains normal to it act in plane strain: `plane`
    (r,) are the masks of such laws, `masks` (r,) those of `strains`, as of `strain_data`. All
    elements are looked at at points of a `rule`.
    """
    for (label, mask), data in zip(masks.items(), strains, strict=True):
        if data.dim == 4:
            every = view.mesh.MapToAllElements(rule, ng.VOL)
            points = every[mask[view.bodies][every["nr"]]]
            values = data(points)
            bad = np.abs(values[:, 1] - values[:, 2]) > SYMMETRIC * np.abs(values).max(initial=0.0)
            refuse_where(points, bad, values, label, "a strain is symmetric, xy = yx")
        for body, where in plane.items() if data.dim in (1, 3) else ():
            if (mask & where).any():
                raise ValueError(
                    f"{label} has a part normal to the plane, and the 3x3 law of {body} does not "
                    "tell what that does in plane strain: give the pair (xx, yy) of strains in the "
                    "plane that leave it without stress"
                )
