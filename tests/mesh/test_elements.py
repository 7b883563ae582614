"""Sizes of elements."""

from __future__ import annotations

import ngsolve as ng
import numpy as np
import pytest

from drivers.reference import cases
from ngcontact.mesh.generation import diameters


def test_diameters_are_longest_sides():
    mesh = ng.Mesh(cases.one_transition().problem.geometry.GenerateMesh(maxh=10))
    x = np.array(mesh.ngmesh.Coordinates())[:, :2]
    for element, h in zip(mesh.Elements(ng.VOL), diameters(mesh), strict=True):
        a, b, c = (x[v.nr] for v in element.vertices)
        sides = [np.linalg.norm(p - q) for p, q in ((a, b), (b, c), (c, a))]
        assert h == pytest.approx(max(sides), rel=1e-14)
