"""Hooke's laws of the bodies: the coefficients c_ijkl of HH81 (2.7) in the plane."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import ngsolve as ng
import numpy as np

from .values import refuse_where, scalar_data

MODEL_NAMES = ("plane strain", "plane stress")

SYMMETRIC = 1e-12  # difference of entries, relative to the largest: input has that many digits
DEFINITE = 16 * np.finfo(float).eps  # a pivot, relative to where it starts: round-off of zero

_RIGHT_E = "Young's modulus must be positive and finite"
_RIGHT_NU = "Poisson's ratio must lie in -1 < nu < 1/2"


def require_model(model: str) -> str:
    """Return a name of `MODEL_NAMES`; anything else is a `TypeError` or a `ValueError`."""
    if not isinstance(model, str):
        raise TypeError(f"model = {model!r}: give one of the strings {MODEL_NAMES}")
    if model not in MODEL_NAMES:
        state = "is not available yet" if model == "axisymmetric" else "is unknown"
        raise ValueError(f'model "{model}" {state}: choose one of {MODEL_NAMES}')
    return model


@dataclass(frozen=True, eq=False)
class Elastic:
    """Isotropic linear elasticity.

    Parameters
    ----------
    E
        Young's modulus, any consistent unit of stress; a number or a scalar CoefficientFunction.
    nu
        Poisson's ratio, dimensionless; a number or a scalar CoefficientFunction.

    Raises
    ------
    TypeError
        If a value is neither a real number nor a scalar CoefficientFunction.
    ValueError
        If a number violates E > 0 or -1 < nu < 1/2, the ellipticity HH81 (2.7).
    """

    E: float | ng.CoefficientFunction
    nu: float | ng.CoefficientFunction

    def __post_init__(self) -> None:
        """Validate what is a number; a CoefficientFunction waits for `check_at`."""
        object.__setattr__(self, "E", scalar_data(self.E, "E"))
        object.__setattr__(self, "nu", scalar_data(self.nu, "nu"))
        if isinstance(self.E, float) and not self.E > 0:
            raise ValueError(f"E = {self.E}: {_RIGHT_E}")
        if isinstance(self.nu, float) and not -1 < self.nu < 0.5:  # (2.7)
            raise ValueError(f"nu = {self.nu}: {_RIGHT_NU}")

    def voigt(self, model: str = "plane strain") -> ng.CoefficientFunction:
        """Return the in-plane law, dims (3, 3): (xx, yy, xy) stress from (xx, yy, gamma_xy)."""
        if require_model(model) == "plane strain":
            scale = self.E / ((1 + self.nu) * (1 - 2 * self.nu))
            normal, cross = scale * (1 - self.nu), scale * self.nu
        else:
            normal = self.E / (1 - self.nu * self.nu)
            cross = normal * self.nu
        shear = self.E / (2 * (1 + self.nu))
        # NGSolve takes numbers in a tuple slowly, and loses an interruption that comes meanwhile.
        n, c, s, zero = (ng.CF(value) for value in (normal, cross, shear, 0.0))
        return ng.CF((n, c, zero, c, n, zero, zero, zero, s), dims=(3, 3))

    def shear_modulus(self, model: str = "plane strain") -> ng.CoefficientFunction:
        """Return mu = E / 2 (1 + nu), the same in both models."""
        require_model(model)
        return ng.CF(self.E / (2 * (1 + self.nu)))

    def check_at(self, points: np.ndarray, name: str) -> None:
        """Refuse values outside HH81 (2.7) at mesh `points` (n,); `name` leads the message."""
        if not isinstance(self.E, float):
            E = self.E(points).ravel()
            refuse_where(points, ~((E > 0) & np.isfinite(E)), E, f"{name}.E", _RIGHT_E)
        if not isinstance(self.nu, float):
            nu = self.nu(points).ravel()
            refuse_where(points, ~((nu > -1) & (nu < 0.5)), nu, f"{name}.nu", _RIGHT_NU)


@dataclass(frozen=True, eq=False)
class Hooke:
    """General linear elasticity in the plane.

    Parameters
    ----------
    C
        c_ijkl as a symmetric 3x3 Voigt matrix in the order xx, yy, xy with the engineering shear
        gamma_xy = 2 eps_xy, any consistent unit of stress: nested numbers (kept as a read-only
        copy) or a CoefficientFunction of dims (3, 3). It is the in-plane law of the chosen model
        already and is used as it is.

    Raises
    ------
    TypeError
        If C is neither a matrix of real numbers nor a CoefficientFunction.
    ValueError
        If C has another shape or its numbers are not finite, symmetric and elliptic, HH81 (2.7).
    """

    C: Sequence[Sequence[float]] | np.ndarray | ng.CoefficientFunction

    def __post_init__(self) -> None:
        """Validate a matrix of numbers; a CoefficientFunction waits for `check_at`."""
        if isinstance(self.C, ng.CoefficientFunction):
            if tuple(self.C.dims) != (3, 3):
                raise ValueError(f"C has dims {tuple(self.C.dims)}: a Voigt matrix has (3, 3)")
            if self.C.is_complex:
                raise TypeError("C is a complex CoefficientFunction: it must be real")
            return
        matrix = _real_matrix(self.C)
        for bad, right in _faults(matrix[np.newaxis]):
            if bad[0]:
                raise ValueError(f"C = {matrix.tolist()}: {right}")
        matrix.setflags(write=False)
        object.__setattr__(self, "C", matrix)

    def voigt(self, model: str = "plane strain") -> ng.CoefficientFunction:
        """Return C as a CoefficientFunction of dims (3, 3), whatever the model."""
        require_model(model)
        if isinstance(self.C, np.ndarray):
            return ng.CF(tuple(self.C.ravel().tolist()), dims=(3, 3))
        return ng.CF(self.C)

    def shear_modulus(self, model: str = "plane strain") -> ng.CoefficientFunction:
        """Return a scalar modulus that bounds C from below, or is typical of it.

        For numbers it is half of the best c_0 in HH81 (2.7), mu for an isotropic law with
        nu >= 0. For a CoefficientFunction it is the shear entry C_33.
        """
        require_model(model)
        if isinstance(self.C, np.ndarray):
            mandel = np.array([1.0, 1.0, math.sqrt(2.0)])
            return ng.CF(float(np.linalg.eigvalsh(mandel[:, None] * self.C * mandel)[0]) / 2)
        return ng.CF(self.C)[2, 2]

    def check_at(self, points: np.ndarray, name: str) -> None:
        """Refuse values outside HH81 (2.7) at mesh `points` (n,); `name` leads the message."""
        if not isinstance(self.C, np.ndarray):
            matrices = ng.CF(self.C)(points).reshape(-1, 3, 3)
            for bad, right in _faults(matrices):
                refuse_where(points, bad, matrices, f"{name}.C", right)


def varies(law: Elastic | Hooke) -> bool:
    """Whether a law is given by functions rather than by numbers."""
    return any(isinstance(value, ng.CoefficientFunction) for value in vars(law).values())


def _real_matrix(data: Any) -> np.ndarray:
    """Return a float copy of shape (3, 3)."""
    right = "give a 3x3 matrix of real numbers or a CoefficientFunction"
    try:
        matrix = np.array(data)
    except (TypeError, ValueError) as error:
        raise TypeError(f"C = {data!r}: {right}") from error
    if matrix.dtype.kind not in "iuf":
        raise TypeError(f"C = {data!r}: {right}")
    if matrix.shape != (3, 3):
        raise ValueError(f"C has shape {matrix.shape}: a Voigt matrix has (3, 3)")
    return matrix.astype(float)


def _faults(matrices: np.ndarray) -> list[tuple[np.ndarray, str]]:
    """Return (bad, what would be right) per condition for Voigt matrices (n, 3, 3), bad (n,).

    Definite by the pivots of L D L^T, each against the diagonal entry it starts from: so the
    verdict is the same in all units.
    """
    finite = np.isfinite(matrices).all(axis=(1, 2))
    size = np.abs(matrices).max(axis=(1, 2))
    with np.errstate(all="ignore"):  # a pivot that is zero or not a number is the finding itself
        skew = np.abs(matrices - matrices.transpose(0, 2, 1)).max(axis=(1, 2)) / size
        a, b, c = (matrices[:, i, i] for i in range(3))
        ab, ac, bc = matrices[:, 0, 1], matrices[:, 0, 2], matrices[:, 1, 2]
        second = b - ab * (ab / a)
        rest = bc - ab * (ac / a)
        third = c - ac * (ac / a) - rest * (rest / second)
        # A small second pivot enlarges the round-off in the third: bound their product.
        share = second / b
        definite = (  # (2.7)
            (a > 0) & (b > 0) & (c > 0) & (share > DEFINITE) & (share * (third / c) > DEFINITE)
        )
    return [
        (~finite, "the entries of a Voigt matrix must be finite"),
        (skew > SYMMETRIC, "a Voigt matrix must be symmetric"),
        (~definite, "a Voigt matrix must be positive definite (elliptic)"),
    ]
