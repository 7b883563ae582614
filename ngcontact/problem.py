"""The continuous contact problem of HH81 section 3: laws, pairs, supports, loads, checks."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import ngsolve as ng
import numpy as np
from netgen.occ import OCCGeometry

from .material import Elastic, Hooke, require_model, scalar_data

Scalar: TypeAlias = float | ng.CoefficientFunction
Vector: TypeAlias = Sequence[Scalar] | ng.CoefficientFunction
Gap: TypeAlias = float | ng.CoefficientFunction | Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Contact:
    """A pair of boundaries Gamma_K that may touch: d.(v_secondary - v_primary) <= gap.

    Parameters
    ----------
    secondary
        Name or pattern of the boundary that carries the contact points.
    primary
        Name or pattern of the boundary it meets; None is a rigid obstacle and needs `gap`.
    direction
        None: d is the outward normal of the secondary at each point, the bounded zone HH81 (3.9).
        A pair: the fixed direction xi from the secondary body to the primary one, the enlarging
        zone HH81 (3.9'); kept as a unit vector.
    gap
        None: measured from the geometry along d. A number, a scalar CoefficientFunction or a
        function of the coordinate arrays x, y (n,) that returns (n,) overrides it; a length.
    bilateral
        Equality in place of the inequality, HH81 Remark 3.3.

    Raises
    ------
    TypeError, ValueError
        If a value has the wrong type, length or range, with the value and what would be right.
    """

    secondary: str
    primary: str | None = None
    direction: Sequence[float] | None = None
    gap: Gap | None = None
    bilateral: bool = False

    def __post_init__(self) -> None:
        """Validate and normalise."""
        _name(self.secondary, "secondary")
        if self.primary is not None:
            _name(self.primary, "primary")
        elif self.gap is None:
            raise ValueError(
                f'contact of "{self.secondary}" has primary=None and gap=None: a rigid obstacle '
                "(primary=None) needs gap"
            )
        if self.direction is not None:
            object.__setattr__(self, "direction", _unit(self.direction))
        if isinstance(self.gap, ng.CoefficientFunction) or not callable(self.gap):
            gap = None if self.gap is None else scalar_data(self.gap, "gap")
            object.__setattr__(self, "gap", gap)
        if not isinstance(self.bilateral, bool):
            raise TypeError(f"bilateral = {self.bilateral!r}: give True or False")


@dataclass(frozen=True, eq=False)
class Problem:
    """Elastic bodies with their supports, loads and contact zones; any consistent units.

    Every name is an NGSolve name or pattern (`"left|right"`); `check` compares them with a mesh.

    Parameters
    ----------
    geometry
        OCCGeometry of dimension 2, or an ngsolve.Mesh, which is used as it is.
    materials
        `Elastic` or `Hooke` per body, a body being a named material region.
    displacement
        Gamma_u: per boundary a pair of numbers, scalar CoefficientFunctions or None (component
        left free), or a CoefficientFunction of dim 2. Kept as pairs of CoefficientFunction or None.
    sliding
        Gamma_0, u.n = 0 without shear: a name or several. Kept as one pattern, or None.
    traction
        Gamma_tau: per boundary a number or a scalar CoefficientFunction, the pressure p of the
        traction -p n, or a pair, or a CoefficientFunction of dim 2. Kept as CoefficientFunction
        of dim 1 or 2; `traction_vector` is the traction itself.
    force
        F per body and area: a pair or a CoefficientFunction of dim 2. Kept as the latter.
    contact
        Gamma_K: the pairs, kept as a tuple.
    model
        "plane strain" or "plane stress".

    Raises
    ------
    TypeError, ValueError
        If a value has the wrong type, length or range, with the value and what would be right.
    """

    geometry: OCCGeometry | ng.Mesh
    materials: Mapping[str, Elastic | Hooke]
    displacement: Mapping[str, Sequence[Scalar | None] | ng.CoefficientFunction] = field(
        default_factory=dict
    )
    sliding: str | Sequence[str] | None = None
    traction: Mapping[str, Scalar | Vector] = field(default_factory=dict)
    force: Mapping[str, Vector] = field(default_factory=dict)
    contact: Sequence[Contact] = ()
    model: str = "plane strain"

    def __post_init__(self) -> None:
        """Validate types and numbers; names and CoefficientFunctions wait for `check`."""
        if not isinstance(self.geometry, OCCGeometry | ng.Mesh):
            raise TypeError(
                f"geometry is a {type(self.geometry).__name__}: give an OCCGeometry or ngsolve.Mesh"
            )
        require_model(self.model)
        materials = _mapping(self.materials, "materials", _law)
        if not materials:
            raise ValueError("materials = {}: give every body an Elastic or a Hooke")
        for name, value in {
            "materials": materials,
            "displacement": _mapping(self.displacement, "displacement", _components),
            "sliding": _pattern(self.sliding),
            "traction": _mapping(self.traction, "traction", _traction),
            "force": _mapping(self.force, "force", _vector),
            "contact": _contacts(self.contact),
        }.items():
            object.__setattr__(self, name, value)

    def traction_vector(self, pattern: str) -> ng.CoefficientFunction:
        """Return P of HH81 (3.7) on a key of `traction`, dim 2; a pressure p becomes -p n."""
        load: ng.CoefficientFunction = self.traction[pattern]
        return -load * ng.specialcf.normal(2) if load.dim == 1 else load

    def check(self, mesh: ng.Mesh) -> None:
        """Refuse names and data that do not fit the mesh; see `check.check_problem`."""
        from ngcontact.check import check_problem  # stating a problem does not need it

        check_problem(self, mesh)


def _name(value: Any, what: str) -> str:
    if not isinstance(value, str):
        raise TypeError(f"{what} = {value!r}: give a region name or pattern, a string")
    if not value:
        raise ValueError(f'{what} = "": give a region name or pattern')
    return value


def _mapping(value: Any, what: str, normalise: Callable[[Any, str], Any]) -> dict[str, Any]:
    """Return a plain dict of normalised values; None is empty."""
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise TypeError(f"{what} = {value!r}: give a dict from region names to values")
    return {
        _name(name, f"a name in {what}"): normalise(entry, f'{what} "{name}"')
        for name, entry in value.items()
    }


def _law(value: Any, what: str) -> Elastic | Hooke:
    if not isinstance(value, Elastic | Hooke):
        raise TypeError(f"{what} = {value!r}: give an Elastic or a Hooke")
    return value


def _pair(value: Any, what: str) -> tuple[Any, Any]:
    """Return the two entries of a sequence or of a CoefficientFunction of dim 2."""
    if isinstance(value, ng.CoefficientFunction):
        if tuple(value.dims) != (2,):
            dims = tuple(value.dims)
            raise ValueError(f"{what} is a CoefficientFunction of dims {dims}: give a 2-vector")
        return value[0], value[1]
    if not isinstance(value, Sequence | np.ndarray) or isinstance(value, str):
        raise TypeError(f"{what} = {value!r}: give a pair or a CoefficientFunction of dim 2")
    if len(value) != 2:
        raise ValueError(f"{what} = {value!r} has length {len(value)}: give a pair")
    return value[0], value[1]


def _components(value: Any, what: str) -> tuple[ng.CoefficientFunction | None, ...]:
    pair = tuple(
        None if entry is None else ng.CF(scalar_data(entry, what)) for entry in _pair(value, what)
    )
    if pair == (None, None):
        raise ValueError(f"{what} = (None, None) prescribes nothing: leave the boundary out")
    return pair


def _vector(value: Any, what: str) -> ng.CoefficientFunction:
    entries = tuple(scalar_data(entry, what) for entry in _pair(value, what))
    return value if isinstance(value, ng.CoefficientFunction) else ng.CF(entries)


def _traction(value: Any, what: str) -> ng.CoefficientFunction:
    """Return a pressure (dim 1) or a traction (dim 2)."""
    vector = isinstance(value, Sequence | np.ndarray) and not isinstance(value, str)
    if vector or (isinstance(value, ng.CoefficientFunction) and value.dim != 1):
        return _vector(value, what)
    return ng.CF(scalar_data(value, what))


def _pattern(value: Any) -> str | None:
    """Return one pattern for a name, several or none."""
    if value is None or isinstance(value, str):
        return value if value is None else _name(value, "sliding")
    if not isinstance(value, Sequence):
        raise TypeError(f"sliding = {value!r}: give a region name or a sequence of names")
    return "|".join(_name(entry, "an entry of sliding") for entry in value) or None


def _unit(value: Any) -> tuple[float, float]:
    """Return a direction as a unit vector; the size of its entries never overflows."""
    x, y = (scalar_data(entry, "direction") for entry in _pair(value, "direction"))
    if not (isinstance(x, float) and isinstance(y, float)):
        raise TypeError(f"direction = {value!r}: give a pair of numbers, one direction for all")
    size = max(abs(x), abs(y))
    if size == 0:
        raise ValueError(f"direction = ({x}, {y}): give a vector from secondary to primary body")
    length = math.hypot(x / size, y / size)
    return x / size / length, y / size / length


def _contacts(value: Any) -> tuple[Contact, ...]:
    if not isinstance(value, Sequence) or isinstance(value, str):
        raise TypeError(f"contact = {value!r}: give a list of Contact(...)")
    for number, entry in enumerate(value):
        if not isinstance(entry, Contact):
            raise TypeError(f"contact[{number}] = {entry!r}: give a Contact(...)")
    return tuple(value)
