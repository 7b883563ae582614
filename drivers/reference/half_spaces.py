"""Hertz's formulas for half-spaces (Johnson 1985, chapter 4)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass


def reduced(values: Sequence[float]) -> float:
    """1 / (1 / R_1 + 1 / R_2): radii of two bodies in contact, or their plane moduli."""
    return 1 / sum(1 / value for value in values)


def plane_modulus(E: float, nu: float) -> float:
    """E / (1 - nu^2)."""
    return E / (1 - nu**2)


@dataclass(frozen=True)
class Hertz:
    """Spheres or parallel cylinders under a force, of cylinders per length.

    1 / `radius` = 1 / R_1 + 1 / R_2, 1 / `modulus` = (1 - nu_1^2) / E_1 + (1 - nu_2^2) / E_2.
    """

    force: float
    radius: float
    modulus: float

    def sphere(self) -> tuple[float, float]:
        """Radius of the circle of contact, and largest pressure."""
        a = (3 * self.force * self.radius / (4 * self.modulus)) ** (1 / 3)
        return a, 1.5 * self.force / (math.pi * a**2)

    def cylinder(self) -> tuple[float, float]:
        """Half-width of the strip of contact, and largest pressure."""
        a = math.sqrt(4 * self.force * self.radius / (math.pi * self.modulus))
        return a, 2 * self.force / (math.pi * a)
