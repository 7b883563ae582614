"""Balance of forces, and penetration between the points of a mesh, from the data of a scene."""

from __future__ import annotations

import ngsolve as ng
import numpy as np

from drivers.stress.scenes.checks.measures import contact_forces, loads, stress
from drivers.stress.scenes.posing import field_of, values_at
from drivers.stress.scenes.scene import Pair, Scene
from drivers.stress.scenes.sides import Array, Side
from ngcontact import Solution

SAMPLES = 17  # of a segment, its ends among them


def unbalanced(scene: Scene, solution: Solution) -> float:
    """Largest sum of loads, reactions and contact forces on a body, over the largest of them."""
    mesh, worst, size = solution.mesh, 0.0, 0.0
    order = 2 * solution.order + 2
    reactions, body_of = solution.reactions, scene.body_of
    for names, contact in contact_forces(scene, solution).items():
        bodies = [body for body in scene.bodies if body.name in names.split("+")]
        load = np.array(
            [
                [loads(scene, mesh, ng.CF(e), body, order) for e in ((1, 0), (0, 1))]
                for body in bodies
            ]
        )
        held = [F for side, F in reactions.items() if body_of[side] in {b.name for b in bodies}]
        every = np.array([contact, *load, *held])
        size = max(size, float(np.abs(every).max()))
        worst = max(worst, float(np.abs(every.sum(axis=0)).max()))
    return worst / size if size > 0 else 0.0


def residual(scene: Scene, solution: Solution) -> float:
    """Largest force of the stress that no load, support or contact takes, over the largest.

    Of an own bilinear form on the displacement's space, whose integrals are exact on straight
    sides; away from supports and from the lines of contact it must vanish: Galerkin's equations.
    """
    V, mesh = solution.displacement.space, solution.mesh
    u, v = V.TnT()
    a, f = ng.BilinearForm(V), ng.LinearForm(V)
    for body in scene.bodies:
        dx = ng.dx(definedon=mesh.Materials(body.name))
        a += ng.InnerProduct(stress(ng.Grad(u), body, scene.model), ng.Grad(v)) * dx
        if body.name in scene.weight:
            f += ng.CF(scene.weight[body.name]) * v * dx
    for name, p in scene.pressure.items():
        ds = ng.ds(definedon=mesh.Boundaries(name))
        f += -field_of(p) * (v * ng.specialcf.normal(2)) * ds
    a.Assemble()
    f.Assemble()
    left = (a.mat * solution.displacement.vec - f.vec).Evaluate().FV().NumPy()
    pairs = [name for p in scene.pairs for name in (*p.secondary, *p.primary)]
    taken = V.GetDofs(mesh.Boundaries("|".join([*scene.clamped, *scene.sliding, *pairs])))
    free = ~np.array(taken, dtype=bool)
    size = np.abs(left).max()
    return float(np.abs(left[free]).max(initial=0.0) / size) if size > 0 else 0.0


def along_sides(scene: Scene, solution: Solution) -> dict[tuple[str, int], tuple[Array, Array]]:
    """Samples of the displacement on every side: arc lengths (k,) in order and values (k, 2)."""
    mesh = solution.mesh
    rule = ng.IntegrationRule([(t,) for t in np.linspace(0, 1, SAMPLES)], [1.0] * SAMPLES)
    points = mesh.MapToAllElements(rule, ng.BND)
    x = values_at(ng.CF((ng.x, ng.y)), points)
    u = values_at(solution.displacement, points)
    named = np.repeat([el.mat for el in mesh.Elements(ng.BND)], SAMPLES)
    middle = x.reshape(-1, SAMPLES, 2)[:, SAMPLES // 2].repeat(SAMPLES, axis=0)
    found = {}
    for name, sides in scene.sides.items():
        at = np.flatnonzero(named == name)
        nearest = np.argmin([side.arc_length(middle[at])[1] for side in sides], axis=0)
        for i, side in enumerate(sides):
            own = at[nearest == i]
            s, _ = side.arc_length(x[own])
            order = np.argsort(s, kind="stable")
            found[name, i] = s[order], u[own[order]]
    return found


def opposite(
    scene: Scene, pair: Pair, x: Array, d: Array
) -> tuple[Array, list[tuple[str, int, Side]], Array, Array]:
    """The primary on rays (k, 2): nearest signed distances (k,), its sides, which (k,), where (k,).

    NaN distances where the ray meets none.
    """
    sides = [(n, i, side) for n in pair.primary for i, side in enumerate(scene.sides[n])]
    met = [side.met(x, d) for *_, side in sides]
    t, s = np.array([t for t, _ in met]), np.array([s for _, s in met])
    which = np.where(np.isnan(t), np.inf, np.abs(t)).argmin(axis=0)
    k = np.arange(len(x))
    return t[which, k], sides, which, s[which, k]


def penetration(scene: Scene, solution: Solution) -> float:
    """How far bodies overlap between all points of their lines, the root of an energy.

    Per thickness: of the integral of the squared overlap times the softer modulus over the length
    of a segment, about what takes the overlap away, on lines of the exact geometry.
    """
    samples = along_sides(scene, solution)
    modulus = min(body.E for body in scene.bodies)
    total = 0.0
    for pair in scene.pairs:
        for name in pair.secondary:
            for i, side in enumerate(scene.sides[name]):
                s, u = samples[name, i]
                x, normal = side.point(s), side.normal(s)
                d = normal if pair.direction is None else np.tile(pair.direction, (len(s), 1))
                jump = (u * d).sum(axis=1)
                if pair.primary:
                    gap, sides, which, there = opposite(scene, pair, x, d)
                    for k, (other, j, _) in enumerate(sides):
                        at = (which == k) & ~np.isnan(gap)
                        t, v = samples[other, j]
                        facing = np.column_stack([np.interp(there[at], t, v[:, c]) for c in (0, 1)])
                        jump[at] -= (facing * d[at]).sum(axis=1)
                if pair.gap is not None:
                    gap = pair.gap(x)
                over = np.nan_to_num(jump - gap).clip(0)
                over[(normal * d).sum(axis=1) <= 0] = 0.0
                h = side.length / max(1, (len(s) // SAMPLES))
                total += modulus / h * float(np.trapezoid(over**2, s))
    return total**0.5
