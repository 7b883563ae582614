"""The continuous contact problem of HH81 (2.6), (3.1)-(3.12): data only, nothing discrete."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import ngsolve as ng
import numpy as np
from netgen.occ import OCCGeometry

from . import checks
from .contact import Contact
from .material import ABOUT_AN_AXIS, SOLID, Elastic, Hooke, model_for, varies
from .mesh_arrays import MeshArrays
from .values import (
    TUPLES,
    Scalar,
    Vector,
    body_mask,
    boundary_mask,
    by_region,
    displacement_components,
    numbers,
    region_pattern,
    strain_components,
    strain_data,
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
        OCCGeometry of dimension 2 or of solids, or an ngsolve.Mesh, which is used as it is. Its
        dimension d is that of the bodies: vectors are pairs in the plane and triples in space.
    materials
        `Elastic` or `Hooke` per body, a body being a named material region.
    displacement
        Gamma_u: per boundary d numbers, scalar CoefficientFunctions or None (component left
        free), or a CoefficientFunction of dim d, in units of length. Kept as tuples of
        CoefficientFunction or None.
    sliding
        Gamma_0, u.n = 0 without shear: a name or several. Kept as one pattern, or None.
    traction
        Gamma_tau: per boundary a number or a scalar CoefficientFunction, the pressure p of the
        traction -p n with the outward normal n of the body, or d of them, or a
        CoefficientFunction of dim d, in units of stress. Kept as CoefficientFunction of dim 1 or d;
        `traction_vector` is the traction itself.
    force
        F per body and area, or volume: d numbers or a CoefficientFunction, consistent units.
        Kept as the latter.
    contact
        Gamma_K: the pairs, kept as a tuple.
    model
        "plane strain" (when left out), "plane stress" or "axisymmetric": a body of revolution
        about x = 0 by its meridian section, x = r >= 0 and y = z; loads are per area and volume of
        the body, forces those of the whole body. Solids take none, and have "solid".
    strain
        Initial strain e0 per body, dimensionless, as alpha dT of a body that is heated: the stress
        is C (e(u) - e0). A number acts in all three directions; a pair is (xx, yy), with none
        normal to the plane; a triple (xx, yy, zz), about an axis (rr, zz, hoop); or a symmetric
        matrix (2, 2) in the plane. Numbers or CoefficientFunctions. Kept as CoefficientFunction.

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
    model: str = None  # type: ignore[assignment]  # a name, once it is made
    strain: Mapping[str, Scalar | Vector | Sequence[Vector]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Validate types and numbers; names and CoefficientFunctions wait for `check`."""
        if not isinstance(self.geometry, OCCGeometry | ng.Mesh):
            raise TypeError(
                f"geometry is {checks.kind_of(self.geometry)}: give an OCCGeometry or ngsolve.Mesh"
            )
        dim = checks.dimension_of(self.geometry)
        object.__setattr__(self, "model", model_for(dim, self.model))
        materials = by_region(self.materials, "materials", partial(_law, model=self.model))
        if not materials:
            raise ValueError("materials = {}: give every body an Elastic or a Hooke")
        for name, value in {
            "materials": materials,
            "displacement": by_region(
                self.displacement, "displacement", partial(displacement_components, dim=dim)
            ),
            "sliding": region_pattern(self.sliding),
            "traction": by_region(self.traction, "traction", partial(traction_data, dim=dim)),
            "force": by_region(self.force, "force", partial(vector_data, dim=dim)),
            "contact": _contacts(self.contact, dim),
            "strain": by_region(self.strain, "strain", partial(strain_data, dim=dim)),
        }.items():
            object.__setattr__(self, name, value)

    @property
    def dim(self) -> int:
        """The dimension of the bodies, and of vectors."""
        return 3 if self.model == SOLID else 2

    @property
    def guide(self) -> str | None:
        """Gamma_0, `sliding`, as one pattern; None without."""
        return None if self.sliding is None else str(self.sliding)

    def refuse_solids(self, what: str) -> None:
        """Raise a `ValueError` for solids, which `what` does not serve."""
        if self.dim == 3:
            raise ValueError(f"{what} is not available for solids: see docs/solids.md")

    def __repr__(self) -> str:
        """Summary in a few words, instead of all data."""
        pairs = ", ".join(pair.named() for pair in self.contact) or "none"
        return f"Problem({self.model}; bodies {', '.join(self.materials)}; contact {pairs})"

    def traction_vector(self, pattern: str) -> ng.CoefficientFunction:
        """Return P of HH81 (3.7) on a key of `traction`, dim d; a pressure p becomes -p n.

        The normal n is that of the element beside a facet, outward whichever way this runs.
        """
        load: ng.CoefficientFunction = self.traction[pattern]
        if load.dim > 1:
            return load  # P in (3.7)
        return -load * ng.BoundaryFromVolumeCF(ng.specialcf.normal(self.dim))

    @property
    def varying(self) -> dict[str, Elastic | Hooke]:
        """Laws, by keys of `materials`, whose stress need be no polynomial where e(u) is one.

        Laws that are functions; all, where an initial strain is one.
        """
        every = not all(map(numbers, self.strain.values()))
        return {key: law for key, law in self.materials.items() if every or varies(law)}

    def check(self, mesh: ng.Mesh) -> None:
        """Refuse names and data that do not fit a mesh.

        Raises
        ------
        TypeError
            If `mesh` is not an `ngsolve.Mesh`, or a gap function does not return numbers.
        ValueError
            If the mesh is no valid mesh of simplices, a name selects nothing, two conditions
            meet on one boundary, a contact pair is impossible, or data are not finite or not
            elliptic.
        """
        checks.check_mesh(mesh, self.dim)
        view, names = MeshArrays(mesh), mesh.GetBoundaries()
        if isinstance(self.geometry, ng.Mesh) or len(view.vertices) != mesh.nv:
            checks.check_numbers(view)

        def regions(argument: str, patterns: Iterable[str]) -> checks.Masks:
            bodies = argument in ("materials", "force", "strain")
            mask_of = body_mask if bodies else boundary_mask
            return checks.regions_of(mesh, argument, patterns, mask_of)

        materials, force = regions("materials", self.materials), regions("force", self.force)
        strain = regions("strain", self.strain)
        displacement = regions("displacement", self.displacement)
        traction = regions("traction", self.traction)
        sliding = regions("sliding", [self.sliding] if isinstance(self.sliding, str) else [])
        pairs = [
            regions(f"contact[{j}].secondary", pair.sides[:1])
            | regions(f"contact[{j}].primary", pair.sides[1:])
            for j, pair in enumerate(self.contact)
        ]

        covered = np.logical_or.reduce(list(materials.values()))
        for number, name in enumerate(mesh.GetMaterials()):
            if not covered[number]:
                raise ValueError(f'body "{name}" has no material: add materials["{name}"]')
        prescribed = zip(displacement.items(), self.displacement.values(), strict=True)
        full = {key: mask for (key, mask), parts in prescribed if None not in parts}
        others = displacement | traction | sliding
        for one, other, right in (
            (sliding, displacement, "keep one of the two"),
            (traction, sliding, "keep one of the two"),
            (traction, full, "keep one, or leave a component free by None"),
            *((sides, others, "a contact boundary takes no other condition") for sides in pairs),
        ):
            checks.refuse_common(names, one, other, right)
        checks.check_overlaps(view)
        inner, shared = (
            np.bincount(view.boundaries[facets], minlength=len(names)) > 0
            for facets in (view.inner_facets, view.shared_facets)
        )
        checks.check_pairs(view, pairs, inner)
        checks.check_tractions(names, traction, self.traction.values(), inner, shared)
        gaps = {
            f'contact[{j}].gap of "{pair.secondary}"': next(iter(sides.values()))
            for j, (sides, pair) in enumerate(zip(pairs, self.contact, strict=True))
        }
        for masks, data, rule in (
            (materials, self.materials.values(), checks.ELEMENT_RULES),
            (force, self.force.values(), checks.ELEMENT_RULES),
            (strain, self.strain.values(), checks.ELEMENT_RULES),
            (strain, self.strain.values(), checks.SIDE_RULES),
            (traction, self.traction.values(), checks.FACET_RULES),
            (displacement, self.displacement.values(), checks.END_RULES),
            (gaps, [pair.gap for pair in self.contact], checks.END_RULES),
        ):
            checks.check_values(view, masks, data, rule)
        laws = zip(materials.items(), self.materials.values(), strict=True)
        general = [item for item, law in laws if isinstance(law, Hooke)]
        plane = dict(general if self.model == "plane strain" else [])
        checks.check_strains(view, strain, self.strain.values(), plane)
        if self.model in ABOUT_AN_AXIS:
            sides = [side for pair in self.contact for side in pair.sides]
            vectors = self.displacement, self.traction, self.force
            e0 = {name: strain_components(data) for name, data in self.strain.items()}
            checks.check_about_axis(view, *vectors, sides, e0)


def _law(value: Any, what: str, model: str) -> Elastic | Hooke:
    if not isinstance(value, Elastic | Hooke):
        raise TypeError(f"{what} = {value!r}: give an Elastic or a Hooke")
    if isinstance(value, Hooke):
        value.check_model(model, what)
    return value


def _contacts(value: Any, dim: int) -> tuple[Contact, ...]:
    if not isinstance(value, Sequence) or isinstance(value, str):
        raise TypeError(f"contact = {value!r}: give a list of Contact(...)")
    for number, entry in enumerate(value):
        if not isinstance(entry, Contact):
            raise TypeError(f"contact[{number}] = {entry!r}: give a Contact(...)")
        if entry.direction is not None and len(entry.direction) != dim:
            raise ValueError(
                f"contact[{number}].direction = {tuple(entry.direction)} has length "
                f"{len(entry.direction)}: give {TUPLES[dim]}"
            )
    return tuple(value)
