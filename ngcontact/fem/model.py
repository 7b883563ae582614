"""The model of a plane body: strain and stress of a displacement."""

from __future__ import annotations

import ngsolve as ng


def strain(u: ng.CoefficientFunction) -> ng.CoefficientFunction:
    """Voigt strain (e_xx, e_yy, 2 e_xy) of a displacement or trial function."""
    grad = ng.Grad(u)
    return ng.CF((grad[0, 0], grad[1, 1], grad[0, 1] + grad[1, 0]))
