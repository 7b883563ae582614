"""What equilibrium is in a model: its equations, their tests, and what a place counts for.

In the plane T = s and div T + F = 0. About an axis polynomials stand for T = 2 pi r s: its
divergence and its tractions are those of a plane stress under the loads 2 pi r F and 2 pi r P, and
the hoop stress is what the radial equation says of it, whatever T is:

    2 pi s_hoop = d T_rr / dr + d T_rz / dz + 2 pi r F_r.

So only the axial equation is left, and the axial translation to be tested with. On triangles with
a side on the axis T is r times a polynomial of one degree less; tractions there do no work.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import ngsolve as ng
import numpy as np

from ....arrays import Array, Index, Mask
from ....fem import Model
from ....problem import on_axis
from .partition import Partition
from .polynomials import basis, dimension

ROUND_OFF = 1e-11  # of a load or traction, relative to the largest: met, as is asked at an axis

# Which derivative, or part of the normal, of which stress (xx, yy, xy) in which component.
OF_AXIS = np.array([[[1.0, 0, 0], [0, 0, 1.0]], [[0, 0, 1.0], [0, 1.0, 0]]])


@dataclass(frozen=True)
class Units:
    """Powers of 2 by which all numbers are divided: a stress, a modulus and a length.

    `extent` is that of the model.
    """

    stress: float
    modulus: float
    length: float
    extent: int

    @property
    def traction(self) -> float:
        """A stress by what a length counts for."""
        return self.stress * self.length**self.extent

    @property
    def measure(self) -> float:
        """What belongs to a length on the boundary, by what that counts for."""
        return self.length ** (1 + self.extent)

    @property
    def energy(self) -> float:
        """The energy that belongs to all three, per thickness in the plane."""
        return self.stress**2 / self.modulus * self.length ** (2 + self.extent)

    @property
    def root(self) -> float:
        """Its square root."""
        return (
            self.stress / math.sqrt(self.modulus) * self.length * self.length ** (self.extent / 2)
        )

    @property
    def strain(self) -> float:
        """The strain that belongs to stress and modulus."""
        return self.stress / self.modulus


class Balance(Protocol):
    """What is asked of equilibrium.

    Attributes
    ----------
    extent : int
        Powers of a length in `measure`.
    equations : slice
        Components of the divergence that loads prescribe.
    motions : ndarray of bool (3,)
        Which of the translations and the rotation of a triangle are rigid.
    """

    extent: int
    equations: slice
    motions: Mask

    def measure(self, x: Array) -> Array:
        """What an area or a length counts for, (k, q), at places `x` (k, q, 2); or (k,)."""

    def stress(self, T: ng.CoefficientFunction) -> ng.CoefficientFunction:
        """The stress in the plane that T stands for."""

    def in_middles(self, partition: Partition, T: Array, radial: Array) -> Array:
        """Components (n, 3) or (n, 4) of the stress in the middles by coefficients `T` (n, 3, m).

        (xx, yy, xy), or (rr, zz, rz, hoop) with `radial` (n,) loads r F_r there.
        """

    def rigid_load(self, partition: Partition, at: Index, load: Array) -> Array:
        """What `load` (b, 3, 2, 3) on triangles `at` (b,) counts for, (b, 3, 2, m)."""

    def at_axis(self, partition: Partition) -> Mask:
        """Which vertices lie where nothing counts, (v,)."""


@dataclass(frozen=True)
class _InPlane:
    extent = 0
    equations = slice(0, 2)
    motions = np.array([True, True, True])

    def measure(self, x: Array) -> Array:
        return np.ones(x.shape[:-1])

    def stress(self, T: ng.CoefficientFunction) -> ng.CoefficientFunction:
        return T

    def in_middles(self, partition: Partition, T: Array, radial: Array) -> Array:
        return np.asarray(T @ _in_middle(T.shape[2]))

    def rigid_load(self, partition: Partition, at: Index, load: Array) -> Array:
        return load

    def at_axis(self, partition: Partition) -> Mask:
        return np.zeros(len(partition.vertices), dtype=bool)


@dataclass(frozen=True)
class _AboutAxis:
    extent = 1
    equations = slice(1, 2)
    motions = np.array([False, True, False])

    def measure(self, x: Array) -> Array:
        return 2 * math.pi * x[..., 0]

    def stress(self, T: ng.CoefficientFunction) -> ng.CoefficientFunction:
        return T / (2 * math.pi * ng.x)

    def in_middles(self, partition: Partition, T: Array, radial: Array) -> Array:
        degree = (math.isqrt(8 * T.shape[2] + 1) - 3) // 2
        D = divergence(partition, np.arange(len(T)), degree)[:, 0]
        slope = (D @ T.reshape(len(T), -1, 1))[..., 0] @ _in_middle(D.shape[1])
        measure = self.measure(partition.vertices[partition.triangles].mean(axis=1))
        plane = (T @ _in_middle(T.shape[2])) / measure[:, None]
        return np.column_stack([plane, slope / (2 * math.pi) + radial])

    def rigid_load(self, partition: Partition, at: Index, load: Array) -> Array:
        measure = self.measure(partition.vertices[partition.triangles[at]])
        return np.einsum("bv,vij,bacj->baci", measure, basis(2).hats, load, optimize=True)

    def at_axis(self, partition: Partition) -> Mask:
        return on_axis(partition.vertices)


def divergence(partition: Partition, at: Index, degree: int) -> Array:
    """Operators (b, 2, m, 3 n) from n polynomials for (xx, yy, xy) to the m below, `at` (b,)."""
    n, m = dimension(degree), dimension(degree - 1)
    by_reference = np.einsum("cds,brd->bcrs", OF_AXIS, partition.inverses[at])
    D = np.einsum("bcrs,rij->bcisj", by_reference, basis(degree).derivatives)
    return D.reshape(len(at), 2, m, 3 * n)


def _in_middle(count: int) -> Array:
    """Values (n,) of the `count` polynomials of a degree in the middle of the triangle."""
    degree = (math.isqrt(8 * count + 1) - 3) // 2
    return np.asarray(basis(degree).values(np.array([[1 / 3, 1 / 3]]))[0])


IN_PLANE: Balance = _InPlane()
ABOUT_AXIS: Balance = _AboutAxis()


def balance_of(model: Model) -> Balance:
    """The equilibrium of a model."""
    return ABOUT_AXIS if model.extent else IN_PLANE
