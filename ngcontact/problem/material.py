"""Hooke's laws of the bodies: the coefficients c_ijkl of HH81 (2.7) in each model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, TypeAlias

import ngsolve as ng
import numpy as np

from .values import SYMMETRIC, refuse_where, scalar_data

VOIGT = {  # components of stress and strain in each model, the shear strain an engineering one
    "plane strain": ("xx", "yy", "xy"),
    "plane stress": ("xx", "yy", "xy"),
    "axisymmetric": ("rr", "zz", "hoop", "rz"),
    "solid": ("xx", "yy", "zz", "yz", "xz", "xy"),
}
SHEAR = ("xy", "rz", "yz", "xz")
SOLID = "solid"  # the model of bodies in space, the only one
MODEL_NAMES = tuple(name for name in VOIGT if name != SOLID)
ABOUT_AN_AXIS = ("axisymmetric",)

# Least eigenvalue of a matrix of unit diagonal: round-off of zero.
EIGENVALUE_ROUND_OFF = 16 * np.finfo(float).eps

_RIGHT_E = "Young's modulus must be positive and finite"
_RIGHT_NU = "Poisson's ratio must lie in -1 < nu < 1/2"
_RIGHT_SHAPE = "a Voigt matrix has (3, 3), of a body of revolution (4, 4), of a solid (6, 6)"
SHAPES = {(len(names), len(names)) for names in VOIGT.values()}

Value: TypeAlias = float | ng.CoefficientFunction


def require_model(model: str) -> str:
    """Return a key of `VOIGT`; anything else is a `TypeError` or a `ValueError`."""
    if not isinstance(model, str):
        raise TypeError(f"model = {model!r}: give one of the strings {MODEL_NAMES}")
    if model not in VOIGT:
        raise ValueError(f'model "{model}" is unknown: choose one of {MODEL_NAMES}')
    return model


def model_for(dim: int, model: str | None) -> str:
    """Return the model of bodies of dimension `dim`: the one that was given, or the usual one."""
    if dim == 3:
        if model not in (None, SOLID):
            raise ValueError(f"model = {model!r} is for plane bodies: leave it out with solids")
        return SOLID
    if model == SOLID:
        raise ValueError(f"model = {model!r} is for solids: choose one of {MODEL_NAMES}")
    return MODEL_NAMES[0] if model is None else require_model(model)


def _isotropic(normal: Value, cross: Value, shear: Value, model: str) -> ng.CoefficientFunction:
    """Return a law, dims (q, q), by its entries on the diagonal, beside it, and of shear."""
    # NGSolve takes numbers in a tuple slowly, and loses an interruption that comes meanwhile.
    n, c, s, zero = (ng.CF(value) for value in (normal, cross, shear, 0.0))
    sheared = [name in SHEAR for name in VOIGT[model]]
    entries = [
        (s if one else n) if i == j else (zero if one or other else c)
        for i, one in enumerate(sheared)
        for j, other in enumerate(sheared)
    ]
    return ng.CF(tuple(entries), dims=(len(sheared), len(sheared)))


_isotropic_numbers = lru_cache(_isotropic)  # asked for several times by each level


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
        """Return the law of a model, dims (q, q): stress from strain by the components `VOIGT`.

        In the plane (xx, yy, xy) from (xx, yy, gamma_xy); about an axis (rr, zz, hoop, rz); of
        solids (xx, yy, zz, yz, xz, xy).
        """
        E, nu = (v if isinstance(v, float) else _kept(v) for v in (self.E, self.nu))
        if require_model(model) != "plane stress":
            scale = E / ((1 + nu) * (1 - 2 * nu))
            normal, cross = scale * (1 - nu), scale * nu
        else:
            normal = E / (1 - nu * nu)
            cross = normal * nu
        shear = E / (2 * (1 + nu))
        made = _isotropic if varies(self) else _isotropic_numbers
        return made(normal, cross, shear, model)

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
    """General linear elasticity in the plane, of a body of revolution, or of a solid.

    Parameters
    ----------
    C
        c_ijkl as a symmetric 3x3 Voigt matrix in the order xx, yy, xy with the engineering shear
        gamma_xy = 2 eps_xy, any consistent unit of stress: nested numbers (kept as a read-only
        copy) or a CoefficientFunction of dims (3, 3). It is the in-plane law of the chosen model
        already and is used as it is. For the model "axisymmetric" a 4x4 matrix, or dims (4, 4), in
        the order rr, zz, hoop, rz. For solids a 6x6 matrix, or dims (6, 6), in the order xx, yy,
        zz, yz, xz, xy.

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
            if tuple(self.C.dims) not in SHAPES:
                raise ValueError(f"C has dims {tuple(self.C.dims)}: {_RIGHT_SHAPE}")
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
        """Return C as a CoefficientFunction of dims (q, q), as it is."""
        self.check_model(model, "the law")
        if isinstance(self.C, np.ndarray):
            return ng.CF(tuple(self.C.ravel().tolist()), dims=self.C.shape)
        return _kept(ng.CF(self.C))

    def check_model(self, model: str, name: str) -> None:
        """Refuse a matrix of another model; `name` leads the message."""
        q = len(VOIGT[require_model(model)])
        shape = tuple(self.C.shape if isinstance(self.C, np.ndarray) else ng.CF(self.C).dims)
        if shape != (q, q):
            raise ValueError(
                f'{name}.C has shape {shape}: the model "{model}" needs a {q}x{q} Voigt matrix in '
                f"the order {', '.join(VOIGT[model])}"
            )

    def check_at(self, points: np.ndarray, name: str) -> None:
        """Refuse values outside HH81 (2.7) at mesh `points` (n,); `name` leads the message."""
        if not isinstance(self.C, np.ndarray):
            C = ng.CF(self.C)
            matrices = C(points).reshape(-1, *C.dims)
            for bad, right in _faults(matrices):
                refuse_where(points, bad, matrices, f"{name}.C", right)


def varies(law: Elastic | Hooke) -> bool:
    """Whether a law is given by functions rather than by numbers."""
    return not {*map(type, vars(law).values())} <= {float, np.ndarray}  # what numbers are kept as


def _kept(modulus: ng.CoefficientFunction) -> ng.CoefficientFunction:
    """The same function, of which NGSolve drops no exp(0 x) or cos(0 x) in bilinear forms."""
    zero = ng.Parameter(0.0)
    if modulus.dim == 1:
        return modulus + zero
    return modulus + ng.CF((zero,) * modulus.dim, dims=tuple(modulus.dims))


def _real_matrix(data: Any) -> np.ndarray:
    """Return a float copy of a shape in `SHAPES`."""
    right = (
        "give a 3x3 matrix (4x4 of a body of revolution, 6x6 of a solid) of real numbers or a "
        "CoefficientFunction"
    )
    try:
        matrix = np.array(data)
    except (TypeError, ValueError) as error:
        raise TypeError(f"C = {data!r}: {right}") from error
    if matrix.dtype.kind not in "iuf":
        raise TypeError(f"C = {data!r}: {right}")
    if matrix.shape not in SHAPES:
        raise ValueError(f"C has shape {matrix.shape}: {_RIGHT_SHAPE}")
    return matrix.astype(float)


def _faults(matrices: np.ndarray) -> list[tuple[np.ndarray, str]]:
    """Return (bad, what would be right) per condition for Voigt matrices (n, q, q), bad (n,).

    Definite by the least eigenvalue of the matrix of unit diagonal: the verdict is the same in all
    units.
    """
    finite = np.isfinite(matrices).all(axis=(1, 2))
    size, start = np.abs(matrices).max(axis=(1, 2)), np.diagonal(matrices, axis1=1, axis2=2)
    definite = finite & (start > 0).all(axis=1)
    root = np.sqrt(start[definite])
    scaled = matrices[definite] / root[:, :, None] / root[:, None, :]
    definite[definite] = np.linalg.eigvalsh(scaled)[:, 0] > EIGENVALUE_ROUND_OFF  # (2.7)
    with np.errstate(all="ignore"):  # what is not a number is the finding itself
        skew = np.abs(matrices - matrices.transpose(0, 2, 1)).max(axis=(1, 2)) / size
    return [
        (~finite, "the entries of a Voigt matrix must be finite"),
        (skew > SYMMETRIC, "a Voigt matrix must be symmetric"),
        (~definite, "a Voigt matrix must be positive definite (elliptic)"),
    ]
