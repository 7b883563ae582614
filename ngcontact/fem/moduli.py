"""Moduli of elements, integrals of laws that vary, nearly incompressible bodies."""

from __future__ import annotations

import math
from collections.abc import Callable
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

# Laws (q, q) of numbers, and their bulk and shear moduli, by the model.
CONSTANT: WeakKeyDictionary[Elastic | Hooke, dict[str, Array]] = WeakKeyDictionary()
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


def _sampled(
    problem: Problem, mesh: ng.Mesh, *measures: Callable[[Array], Array], asked: Mask | None = None
) -> Array:
    """Measures (m, ne, 4) at `SAMPLES` of each element, (k, 4) of laws C (k, 4, q, q).

    Voigt components q, the shear last. Only of elements `asked` (ne,) for, 0 in others.
    """
    values = np.zeros((len(measures), mesh.ne, len(SAMPLES)))
    region = MeshArrays(mesh).bodies
    for pattern, law in problem.materials.items():
        at = np.array(mesh.Materials(pattern).Mask())[region]
        at = at if asked is None else at & asked
        if not at.any():
            continue
        C = _constant(law, problem.model, mesh)[None, None] if not varies(law) else None
        if C is None:
            points = mesh.MapToAllElements(SAMPLES, ng.VOL).reshape(-1, len(SAMPLES))[at]
            C = np.asarray(law.voigt(problem.model)(points.ravel()))
            size = round(math.sqrt(C.shape[1]))
            C = C.reshape(-1, len(SAMPLES), size, size)
        for value, measure in zip(values, measures, strict=True):
            value[at] = measure(C)
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
    [smallest] = _sampled(problem, mesh, _smallest, asked=asked)
    return np.asarray(smallest.min(axis=1) / 2)


def bulk_moduli(problem: Problem, mesh: ng.Mesh, asked: Mask | None = None) -> Array:
    """Bulk modulus (ne,) in the middle of each element: the largest kappa <= e : C e / (tr e)^2.

    A stress, lambda + mu of isotropic laws in plane strain, lambda + 2 mu / 3 about an axis. Of
    elements `asked` (ne,) for, 0 elsewhere; of all when left out.
    """
    [bulk] = _sampled(problem, mesh, _bulk, asked=asked)
    return np.asarray(bulk[:, 0])


def stiffnesses(problem: Problem, mesh: ng.Mesh) -> Array:
    """What the estimate asks of the law in each element, rows (3, ne).

    The shear modulus as in `shear_moduli`; the rigidity, half the largest eigenvalue of C less its
    bulk modulus, the largest in the element: a stress, mu of isotropic laws, boundary values w
    store at most 2 mu |w|^2 in H^(1/2); and the ratio of `incompressibilities`.
    """
    smallest, bulk, rigidity = _sampled(problem, mesh, _smallest, _bulk, _rigidity)
    ratio = 2 * bulk[:, 0] / smallest[:, 0]
    return np.array([smallest.min(axis=1) / 2, rigidity.max(axis=1) / 2, ratio])


def incompressibilities(problem: Problem, mesh: ng.Mesh) -> Array:
    """Bulk modulus over half the smallest eigenvalue in the middle of each element, (ne,)."""
    smallest, bulk = _sampled(problem, mesh, _smallest, _bulk)
    return np.asarray(2 * bulk[:, 0] / smallest[:, 0])


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

    There the derivatives of mapped functions are no polynomials: the default rule changes u_h by up
    to 15 % of its error at order 2, this one by 0.05 %. All are `bonus` orders above the default.
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
    """Largest kappa / mu of each body where it exceeds `limit`; `ratio` (ne,) where it is known."""
    ratio = incompressibilities(problem, mesh) if ratio is None else ratio
    if not (ratio > limit).any():
        return {}
    region = MeshArrays(mesh).bodies
    most = dict.fromkeys(mesh.GetMaterials(), 0.0)
    for number, name in enumerate(mesh.GetMaterials()):
        most[name] = max(most[name], float(ratio[region == number].max(initial=0.0)))
    return {name: value for name, value in most.items() if value > limit}


def _of_laws(problem: Problem, mesh: ng.Mesh) -> list[tuple[float, float]] | None:
    """Bulk and shear modulus of each law, wherever it applies; None where one of them varies."""
    found = []
    for law in problem.materials.values():
        if varies(law):
            return None
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
