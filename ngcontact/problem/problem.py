"""The continuous contact problem of HH81 (2.6), (3.1)-(3.12): data only, nothing discrete."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import ngsolve as ng
from netgen.occ import OCCGeometry

from .contact import Contact
from .material import Elastic, Hooke, require_model
from .values import (
    Scalar,
    Vector,
    by_region,
    displacement_components,
    region_pattern,
    traction_data,
    vector_data,
)


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
        materials = by_region(self.materials, "materials", _law)
        if not materials:
            raise ValueError("materials = {}: give every body an Elastic or a Hooke")
        for name, value in {
            "materials": materials,
            "displacement": by_region(self.displacement, "displacement", displacement_components),
            "sliding": region_pattern(self.sliding),
            "traction": by_region(self.traction, "traction", traction_data),
            "force": by_region(self.force, "force", vector_data),
            "contact": _contacts(self.contact),
        }.items():
            object.__setattr__(self, name, value)

    def traction_vector(self, pattern: str) -> ng.CoefficientFunction:
        """Return P of HH81 (3.7) on a key of `traction`, dim 2; a pressure p becomes -p n."""
        load: ng.CoefficientFunction = self.traction[pattern]
        return -load * ng.specialcf.normal(2) if load.dim == 1 else load

    def check(self, mesh: ng.Mesh) -> None:
        """Refuse names and data that do not fit the mesh; see `checks.check_problem`."""
        from .checks import check_problem  # stating a problem does not need it

        check_problem(self, mesh)


def _law(value: Any, what: str) -> Elastic | Hooke:
    if not isinstance(value, Elastic | Hooke):
        raise TypeError(f"{what} = {value!r}: give an Elastic or a Hooke")
    return value


def _contacts(value: Any) -> tuple[Contact, ...]:
    if not isinstance(value, Sequence) or isinstance(value, str):
        raise TypeError(f"contact = {value!r}: give a list of Contact(...)")
    for number, entry in enumerate(value):
        if not isinstance(entry, Contact):
            raise TypeError(f"contact[{number}] = {entry!r}: give a Contact(...)")
    return tuple(value)
