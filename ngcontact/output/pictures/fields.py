"""What colours of a picture show: fields of a solution by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import ngsolve as ng
import numpy as np

from ...arrays import Array
from ...fem import von_mises
from ...solved import Solved
from ..vtk import Nodes, full_stress

Evaluated = Callable[[Array, Array], Array]


@dataclass(frozen=True, eq=False)
class Field:
    """A scalar field of a picture.

    Attributes
    ----------
    label : str
        Its name on the colour scale.
    kind : str
        "stress", "length", or "" where that is not known.
    values : ndarray (k,)
        At the nodes of the picture.
    """

    label: str
    kind: str
    values: Array

    @property
    def signed(self) -> bool:
        """Whether both signs matter: colours are then symmetric about 0."""
        return bool(self.values.min(initial=0.0) < 0)


def _principal(largest: bool) -> Evaluated:
    """Of the principal stresses of xx, yy, xy, zz the largest or the smallest, (k,)."""

    def evaluated(stress: Array, _: Array) -> Array:
        xx, yy, xy, zz = stress.T
        mean, radius = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
        return np.maximum(mean + radius, zz) if largest else np.minimum(mean - radius, zz)

    return evaluated


def _stress(number: int) -> Evaluated:
    """Component of the stress, (k,)."""
    return lambda stress, _: stress[:, number]


def _displacement(axis: int) -> Evaluated:
    """Component of the displacement, (k,)."""
    return lambda _, u: u[:, axis]


def fields(axes: tuple[str, str], across: str) -> dict[str, tuple[str, str, Evaluated]]:
    """Label, kind and function of every field; `across` names the stress normal to the plane.

    Functions map stresses xx, yy, xy, zz (k, 4) and displacements (k, 2) at nodes to values (k,).
    """
    x, y = axes
    parts = {f"{x}{x}": 0, f"{y}{y}": 1, f"{x}{y}": 2, across: 3}
    components = {
        f"stress_{name}": (f"stress {name}", "stress", _stress(k)) for name, k in parts.items()
    }
    moves = {
        f"displacement_{name}": (f"displacement along {name}", "length", _displacement(k))
        for k, name in enumerate(axes)
    }
    return {
        "von_mises": ("von Mises stress", "stress", lambda stress, _: von_mises(stress)),
        **components,
        "largest_principal": ("largest principal stress", "stress", _principal(True)),
        "smallest_principal": ("smallest principal stress", "stress", _principal(False)),
        "mean_pressure": (
            "mean pressure, −tr σ/3",
            "stress",
            lambda stress, _: -(stress[:, 0] + stress[:, 1] + stress[:, 3]) / 3,
        ),
        "displacement": (
            "displacement, absolute value",
            "length",
            lambda _, u: np.hypot(u[:, 0], u[:, 1]),
        ),
        **moves,
    }


def check_field(field: str | ng.CoefficientFunction, axes: tuple[str, str], across: str) -> None:
    """Raise ``ValueError`` or ``TypeError`` unless `field` can be shown."""
    if isinstance(field, ng.CoefficientFunction):
        if field.dim != 1 or field.is_complex:
            raise ValueError(f"field: a function of {field.dim} components; give one real number")
        return
    known = fields(axes, across)
    if not isinstance(field, str):
        raise TypeError(
            f"field = {field!r}: give a CoefficientFunction or one of {', '.join(known)}"
        )
    if field not in known:
        raise ValueError(
            f'field = "{field}": give a CoefficientFunction or one of {", ".join(known)}'
        )


def evaluated(
    solution: Solved,
    nodes: Nodes,
    field: str | ng.CoefficientFunction,
    axes: tuple[str, str],
    across: str,
) -> Field:
    """The chosen `field` at the nodes."""
    if not isinstance(field, str):
        return Field("field", "", nodes.values(field)[:, 0])
    label, kind, function = fields(axes, across)[field]
    u = solution.displacement
    at_nodes = nodes.values(full_stress(solution)), nodes.values(ng.CF((u[0], u[1])))
    return Field(label, kind, function(*at_nodes))
