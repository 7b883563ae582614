"""Sizes and moduli of elements, nearly incompressible bodies, units for squares."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from weakref import WeakKeyDictionary

import ngsolve as ng
import numpy as np

from ..arrays import Array, Mask
from ..errors import warn
from ..problem import Elastic, Hooke, MeshArrays, Problem, varies
from ..quadrature import composite

# kappa / mu from which a body counts as nearly incompressible: nu = 5/12; nowhere in plane stress.
NEARLY_INCOMPRESSIBLE = 6.0
# ... and from which order 1 locks: nu = 0.4545, where errors are 1.3 times those of nu = 0.3.
LOCKING = 11.0

ROUGH_PARTS = 8  # of the sides of an element in which a law is rough, each with a rule of its own
MODULUS_BONUS = 4  # quadrature orders above the default: moduli may be as rough as r^(-1/2)
CURVED = 2  # ... and for the map of a curved element

CONSTANT: WeakKeyDictionary[Elastic | Hooke, dict[str, Array]] = WeakKeyDictionary()
# Bulk and shear modulus of laws of numbers, by the model.
NUMBERS: WeakKeyDictionary[Elastic | Hooke, dict[str, tuple[float, float]]] = WeakKeyDictionary()

# Voigt strains of a unit of volume, without change of volume, and of shear, as rows.
VOLUMETRIC = {
    3: np.array([[0.5, 0.5, 0.0], [0.5, -0.5, 0.0], [0.0, 0.0, 1.0]]),
    4: np.array([[1 / 3, 1 / 3, 1 / 3, 0], [0.5, -0.5, 0, 0], [0.5, 0.5, -1, 0], [0, 0, 0, 1.0]]),
}

# Where a law that varies is looked at in each element: its middle and towards its corners.
SAMPLES = ng.IntegrationRule(
    [(1 / 3, 1 / 3, 0), (0.1, 0.1, 0), (0.8, 0.1, 0), (0.1, 0.8, 0)], [1 / 8] * 4
)


def _laws(
    problem: Problem, mesh: ng.Mesh, asked: Mask | None = None
) -> Iterator[tuple[Mask, Array]]:
    """Elements (ne,) of a law C, and C (k, 4, q, q) at their `SAMPLES`; (1, 1, q, q) of numbers.

    Voigt components q, the shear last. Only elements `asked` (ne,) for are met.
    """
    region, samples = MeshArrays(mesh).bodies, len(SAMPLES)
    for pattern, law in problem.materials.items():
        inside = np.array(mesh.Materials(pattern).Mask())[region]
        at = inside if asked is None else inside & asked
        if not at.any():
            continue
        if varies(law):
            points = mesh.MapToAllElements(SAMPLES, ng.VOL).reshape(-1, samples)[at]
            C = np.asarray(law.voigt(problem.model)(points.ravel()))
            size = round(math.sqrt(C.shape[1]))
            yield at, C.reshape(-1, samples, size, size)
        else:
            yield at, _constant(law, problem.model, mesh)[None, None]


def _of_elements(
    problem: Problem,
    mesh: ng.Mesh,
    modulus: Callable[[Array], Array],
    asked: Mask | None = None,
) -> Array:
    """modulus(C) (ne, 4) at `SAMPLES` of each element, of laws C (..., q, q).

    0 in elements that are not `asked` (ne,) for.
    """
    values = np.zeros((mesh.ne, len(SAMPLES)))
    for at, C in _laws(problem, mesh, asked):
        values[at] = modulus(C)
    return values


def _constant(law: Elastic | Hooke, model: str, mesh: ng.Mesh) -> Array:
    """A law of numbers as a matrix (q, q), made once."""
    kept = CONSTANT.setdefault(law, {})
    if model not in kept:
        rule = ng.IntegrationRule([(1 / 3, 1 / 3, 0)], [1])
        C = np.asarray(law.voigt(model)(mesh.MapToAllElements(rule, ng.VOL)[:1]))
        size = round(math.sqrt(C.size))
        kept[model] = C.reshape(size, size)
    return kept[model]


def mandel(C: Array) -> Array:
    """Laws (..., q, q) on the strain e itself, energy e : C : e / 2, of Voigt's `C` (..., q, q).

    Shear strain is counted twice in e : e, so it is scaled by the root of 2.
    """
    scale = np.ones(C.shape[-1])
    scale[-1] = math.sqrt(2.0)
    return C * scale * scale[:, None]


def _smallest(C: Array) -> Array:
    """The best c_0 (...) in HH81 (2.7): the smallest eigenvalue of the laws (..., q, q)."""
    return np.asarray(np.linalg.eigvalsh(mandel(C))[..., 0])


def _bulk(C: Array) -> Array:
    """The largest kappa (...) <= e : C e / (tr e)^2 of laws (..., q, q).

    A Schur complement in C on volumetric, deviatoric and shear strain, which does not cancel where
    C_11, C_12 and C_22 are nearly equal.
    """
    size = np.abs(C).max(axis=(-2, -1))
    T = VOLUMETRIC[C.shape[-1]]
    D = T @ (C / size[..., None, None]) @ T.T
    bend = np.linalg.solve(D[..., 1:, 1:], D[..., 1:, :1])
    return np.asarray(size * (D[..., 0, 0] - (D[..., :1, 1:] @ bend)[..., 0, 0]))


def _rigidity(C: Array) -> Array:
    """Largest eigenvalue (...) of laws (..., q, q) less kappa (tr e)^2, of a strain without it.

    The energy |w|^2 of boundary values in a half-plane is at most this times their square in
    H^(1/2), as that of the field without divergence among those with these values.
    """
    dilatation = np.append(np.ones(C.shape[-1] - 1), 0.0)
    rest = mandel(C) - _bulk(C)[..., None, None] * np.outer(dilatation, dilatation)
    return np.asarray(np.linalg.eigvalsh(rest)[..., -1])


def shear_moduli(problem: Problem, mesh: ng.Mesh, asked: Mask | None = None) -> Array:
    """Half the smallest eigenvalue (ne,) of the law, the least in each element, a stress.

    That of C on strains, in Mandel's scaling: mu of isotropic laws with nu >= 0, and kappa below.
    Of elements `asked` (ne,) for, 0 elsewhere; of all when left out.
    """
    return _of_elements(problem, mesh, _smallest, asked).min(axis=1) / 2


def bulk_moduli(problem: Problem, mesh: ng.Mesh, asked: Mask | None = None) -> Array:
    """Bulk modulus (ne,) in the middle of each element: the largest kappa <= e : C e / (tr e)^2.

    A stress, lambda + mu of isotropic laws in plane strain, lambda + 2 mu / 3 about an axis. Of
    elements `asked` (ne,) for, 0 elsewhere; of all when left out.
    """
    return _of_elements(problem, mesh, _bulk, asked)[:, 0]


def stiffnesses(problem: Problem, mesh: ng.Mesh) -> tuple[Array, Array, Array]:
    """What the estimate asks of the law in each element.

    Returns
    -------
    mu : ndarray (ne,)
        As in `shear_moduli`.
    rigidity : ndarray (ne,)
        Half the largest eigenvalue of C less its bulk modulus, the largest in the element, a
        stress, mu of isotropic laws: boundary values w store at most 2 mu |w|^2 in H^(1/2).
    ratio : ndarray (ne,)
        Bulk modulus over half the smallest eigenvalue, in the middle.
    """
    mu, rigidity, ratio = np.zeros((3, mesh.ne))
    for at, C in _laws(problem, mesh):
        least = _smallest(C)
        mu[at] = least.min(axis=-1) / 2
        rigidity[at] = _rigidity(C).max(axis=-1) / 2
        ratio[at] = 2 * _bulk(C[:, 0]) / least[:, 0]
    return mu, rigidity, ratio


def incompressibilities(problem: Problem, mesh: ng.Mesh) -> Array:
    """Bulk modulus over half the smallest eigenvalue in the middle of each element, (ne,)."""
    ratio = np.zeros(mesh.ne)
    for at, C in _laws(problem, mesh):
        ratio[at] = 2 * _bulk(C[:, 0]) / _smallest(C[:, 0])
    return ratio


def law_measures(
    mesh: ng.Mesh, body: str, order: int, rough: Mask
) -> list[ng.comp.DifferentialSymbol]:
    """Integrals over a body whose law varies, the last one over its elements `rough` (ne,).

    Of a polynomial of degree `order`, which is that of the form without the law, times the law.
    """
    where = mesh.Materials(body)
    if not rough.any():
        return [ng.dx(definedon=where, bonus_intorder=MODULUS_BONUS)]
    smooth, rest = ng.BitArray(~rough), ng.BitArray(rough)
    rule = {ng.TRIG: composite(ROUGH_PARTS, order + CURVED)}
    return [
        ng.dx(definedon=where, definedonelements=smooth, bonus_intorder=MODULUS_BONUS),
        ng.dx(definedon=where, definedonelements=rest, intrules=rule),
    ]


def constant_measures(
    mesh: ng.Mesh, body: str, curved: Mask, bonus: int = 0
) -> list[ng.comp.DifferentialSymbol]:
    """Integrals over a body whose law is constant, the last one over its elements `curved` (ne,).

    Of quadrature `bonus` orders above the default.

    There the derivatives of mapped functions are no polynomials: the default rule changes u_h by up
    to 15 % of its error at order 2, this one by 0.05 %.
    """
    where = mesh.Materials(body)
    if not curved.any():
        return [ng.dx(definedon=where, bonus_intorder=bonus)]
    straight, rest = ng.BitArray(~curved), ng.BitArray(curved)
    return [
        ng.dx(definedon=where, definedonelements=straight, bonus_intorder=bonus),
        ng.dx(definedon=where, definedonelements=rest, bonus_intorder=CURVED + bonus),
    ]


def nearly_incompressible(
    problem: Problem, mesh: ng.Mesh, limit: float, ratio: Array | None = None
) -> dict[str, float]:
    """Largest kappa / mu of each body where it exceeds `limit`.

    `ratio` (ne,) is that of each element, where it is known.
    """
    if ratio is None:
        ratio = incompressibilities(problem, mesh)
    if not (ratio > limit).any():
        return {}
    region = MeshArrays(mesh).bodies
    most = dict.fromkeys(mesh.GetMaterials(), 0.0)
    for number, name in enumerate(mesh.GetMaterials()):
        most[name] = max(most[name], float(ratio[region == number].max(initial=0.0)))
    return {name: value for name, value in most.items() if value > limit}


def _of_laws(problem: Problem, mesh: ng.Mesh) -> list[tuple[float, float]] | None:
    """Bulk and shear modulus of each law, wherever it applies; None where one of them varies."""
    laws, found = problem.materials.values(), []
    if any(map(varies, laws)):
        return None
    for law in laws:
        kept = NUMBERS.setdefault(law, {})
        if problem.model not in kept:
            C = _constant(law, problem.model, mesh)
            kept[problem.model] = float(_bulk(C)), float(_smallest(C)) / 2
        found.append(kept[problem.model])
    return found


def stiffer_than(problem: Problem, mesh: ng.Mesh, pressure: float) -> bool:
    """Whether no body, as far as is known without a look at elements, is softer than a pressure.

    In confined compression, kappa + mu.
    """
    moduli = _of_laws(problem, mesh)
    return moduli is not None and all(pressure <= kappa + mu for kappa, mu in moduli)


def warn_of_locking(problem: Problem, mesh: ng.Mesh, order: int) -> None:
    """Warn of every body that elements of order 1 are too stiff for."""
    moduli = _of_laws(problem, mesh) if order == 1 else []
    if moduli is not None and all(kappa <= LOCKING * mu for kappa, mu in moduli):
        return
    for name, ratio in nearly_incompressible(problem, mesh, LOCKING).items():
        warn(
            f'body "{name}" is nearly incompressible, lambda / mu = {ratio - 1:.3g}: elements of '
            "order 1 lock; use order=2 or higher"
        )
