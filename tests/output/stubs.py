"""What files and pictures read of a solution, with fields chosen by a test."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import ngsolve as ng
import numpy as np
import pytest
from netgen.occ import Compound, OCCGeometry, WorkPlane, Y

from ngcontact import Contact, Elastic
from ngcontact.fem import MODELS

MAXH = 0.4


def pair_of(points, rows=None, direction=None):
    """State of a pair with these points, on segments of two if `rows` are left out."""
    every = np.arange(len(points))
    rows = np.column_stack([every[:-1], every[1:]]) if rows is None else rows
    node = np.unique(points, axis=0, return_inverse=True)[1].ravel()
    contact = SimpleNamespace(direction=direction)
    line = SimpleNamespace(contact=contact, position=points, node=node, rows=rows)
    return SimpleNamespace(line=line)


@dataclass
class Stub:
    """What the writers read of a solution, with fields chosen by the test."""

    mesh: Any
    order: int
    displacement: Any
    stress: Any
    points: Any
    problem: Any
    out_of_plane_stress: Any
    estimated: bool = False
    stress_free: bool = False

    def __post_init__(self):
        count = len(self.points)
        self.gap = np.linspace(0, 1, count)
        self.pressure = np.linspace(2, 0, count)
        self.force = self.pressure / 10
        self.active = self.pressure > 0.5
        self.pair = np.zeros(count, dtype=int)
        self.direction = self.points - (0.0, 1.0)  # of the disc, of radius 1

    @property
    def pairs(self):
        contact = enumerate(self.problem.contact)
        points = ((self.points[self.pair == k], pair.direction) for k, pair in contact)
        return [pair_of(x, direction=direction) for x, direction in points]

    @property
    def indicators(self):
        if not self.estimated:
            pytest.fail("writing has computed an estimate")
        return np.arange(self.mesh.ne) + 0.5


def two_bodies(glue=Compound):
    """Half disc of radius 1 about (0, 1) on the block |x| <= 2, -1 <= y <= 0."""
    disc = WorkPlane().Circle(0, 1, 1).Face() * WorkPlane().MoveTo(-2, -1).Rectangle(4, 2).Face()
    block = WorkPlane().MoveTo(-2, -1).Rectangle(4, 1).Face()
    disc.faces.name, block.faces.name = "disc", "block"
    disc.edges.name = "disc_arc"
    disc.edges.Max(Y).name = "disc_top"
    block.edges.Max(Y).name = "block_top"
    block.edges.Min(Y).name = "block_bottom"
    return OCCGeometry(glue([disc, block]), dim=2)


def stub(order=3, stress=None, model="plane strain", materials=None, mesh=None, curve=None):
    mesh = ng.Mesh(two_bodies().GenerateMesh(maxh=MAXH)) if mesh is None else mesh
    mesh.Curve(order if curve is None else curve)
    u = ng.GridFunction(ng.VectorH1(mesh, order=order))
    u.Set(ng.CF((0.1 * ng.x * ng.y, 0.05 * ng.x**2 - 0.02 * ng.y)))
    steel = Elastic(E=1.0, nu=0.25)
    problem = SimpleNamespace(
        model=model,
        materials={"disc": steel, "block": steel} if materials is None else materials,
        contact=(Contact("disc_arc", "block_top"),),
    )
    angle = np.linspace(-2.2, -0.9, 9)
    points = np.column_stack([np.cos(angle), 1 + np.sin(angle)])
    if stress is None:
        stress = ng.CF((ng.x, ng.y, ng.y, ng.x * ng.y), dims=(2, 2))
    zz = MODELS[model].out_of_plane(
        problem.materials, {}, mesh, [stress[0, 0], stress[1, 1], stress[0, 1]]
    )
    return Stub(mesh, order, u, stress, points, problem, zz)
