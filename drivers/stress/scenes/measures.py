"""What a solution says in a few numbers, read from its displacement and forces with own formulas.

Of a `Solution` only `displacement`, `mesh`, `points`, `force`, `pair`, `pairs` (directions),
`contact_force` and `error_estimate` are read; integrals are NGSolve's.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import ngsolve as ng
import numpy as np

from drivers.stress.motion import Motion
from drivers.stress.scenes.posing import field_of, values_at
from drivers.stress.scenes.scene import Array, Body, Pair, Scene, Side
from ngcontact import Solution

ALIKE = 1e-6  # relative difference of lengths and cosines that are the same but for round-off


@dataclass(frozen=True)
class Measures:
    """Numbers of one solution, per thickness.

    `along` are arc lengths (k,) and forces (k,) on each side of the secondaries, by name, number.
    """

    norm: Mapping[str, float]  # energy norm of each body, the root of an energy
    energy: float  # potential energy
    force: Mapping[str, Array]  # contact force (2,) on each body, or on several: `contact_forces`
    along: Mapping[tuple[str, int], tuple[Array, Array]]
    error: float  # estimated error in the energy norm

    @property
    def whole(self) -> float:
        """Energy norm of all bodies."""
        return float(np.sqrt(sum(x**2 for x in self.norm.values())))

    @property
    def relative_error(self) -> float:
        """Estimated error over the energy norm; 0 of 0."""
        return self.error / self.whole if self.whole > 0 else 0.0

    def back(self, motion: Motion) -> Measures:
        """The same in the units and the frame before the scene was moved."""
        root = motion.length * motion.modulus**0.5
        stress = motion.length * motion.modulus
        return Measures(
            norm={k: x / root for k, x in self.norm.items()},
            energy=self.energy / root**2,
            force={k: F @ motion.turn / stress for k, F in self.force.items()},
            along={k: (s / motion.length, F / stress) for k, (s, F) in self.along.items()},
            error=self.error / root,
        )


def law(body: Body, model: str) -> tuple[float, float]:
    """Lame's constants of a body, in plane stress the ones that stand for them."""
    mu = body.E / (2 * (1 + body.nu))
    if model == "plane stress":
        return body.E * body.nu / (1 - body.nu**2), mu
    return body.E * body.nu / ((1 + body.nu) * (1 - 2 * body.nu)), mu


def stress(grad: ng.CoefficientFunction, body: Body, model: str) -> ng.CoefficientFunction:
    """Stress (2, 2) of a displacement gradient."""
    lam, mu = law(body, model)
    strain = 0.5 * (grad + grad.trans)
    return 2 * mu * strain + lam * ng.Trace(strain) * ng.Id(2)


def loads(scene: Scene, mesh: ng.Mesh, v: ng.CoefficientFunction, body: Body, order: int) -> float:
    """Work of the loads of a body on a displacement v, per thickness."""
    own = {side.name for side in (*body.sides, *body.inner)}
    n = ng.specialcf.normal(2)
    rates = [(mesh.Boundaries(k), -field_of(p) * n) for k, p in scene.pressure.items() if k in own]
    rates += [(mesh.Materials(k), ng.CF(w)) for k, w in scene.weight.items() if k == body.name]
    return float(sum(ng.Integrate(rate * v, region, order=order) for region, rate in rates))


def _along(scene: Scene, solution: Solution) -> dict[tuple[str, int], tuple[Array, Array]]:
    """Arc lengths and forces of the contact points on each side of the secondaries.

    A point at a corner belongs to the side whose normal it has, between alike ones to the first.
    """
    found: dict[tuple[str, int], list[tuple[float, float]]] = {}
    names = {name for pair in scene.pairs for name in pair.secondary}
    sides = [
        (n, i, side) for n in scene.sides if n in names for i, side in enumerate(scene.sides[n])
    ]
    for j in range(len(scene.pairs)):
        at = solution.pair == j
        x, force, normal = solution.points[at], solution.force[at], solution.pairs[j].line.direction
        place = [side.arc_length(x) for *_, side in sides]
        size = max(side.length for *_, side in sides)
        found_at = zip(sides, place, strict=True)
        score = np.array(
            [
                x / size + 1 - (side.normal(s) * normal).sum(axis=1)
                for (*_, side), (s, x) in found_at
            ]
        )
        best = (score <= score.min(axis=0) + ALIKE).argmax(axis=0)
        for k, b in enumerate(best):
            name, i, _ = sides[b]
            found.setdefault((name, i), []).append((float(place[b][0][k]), float(force[k])))
    return {
        key: (np.array(sorted(rows))[:, 0], np.array(sorted(rows))[:, 1])
        for key, rows in found.items()
    }


def contact_forces(scene: Scene, solution: Solution) -> dict[str, Array]:
    """Contact force (2,) on each body, by its name, or on several whose forces are not told apart.

    The names of these are joined by "+": bodies whose sides one pair names together, and those that
    one secondary faces in several pairs, whose common points count for the first of them.
    """
    group = {body.name: frozenset([body.name]) for body in scene.bodies}

    def join(sides: Iterable[str]) -> None:
        every = frozenset[str]().union(*(group[scene.body_of[side]] for side in sides))
        group.update(dict.fromkeys(every, every))

    for pair in scene.pairs:
        for sides in (pair.secondary, pair.primary):
            if sides:
                join(sides)
        for other in scene.pairs:
            if set(pair.secondary) & set(other.secondary):
                join((*pair.primary, *other.primary))
    force = {bodies: np.zeros(2) for bodies in group.values()}
    for j, pair in enumerate(scene.pairs):
        F = solution.contact_force(j)
        for sides, sign in ((pair.secondary, 1), (pair.primary, -1)):
            if sides:
                bodies = group[scene.body_of[sides[0]]]
                force[bodies] = force[bodies] + sign * F
    return {"+".join(sorted(bodies)): F for bodies, F in force.items()}


def measured(scene: Scene, solution: Solution) -> Measures:
    """The numbers of a solution."""
    u, mesh = solution.displacement, solution.mesh
    order = 2 * solution.order + 2
    grad = ng.Grad(u)
    norm, work = {}, 0.0
    for body in scene.bodies:
        s = stress(grad, body, scene.model)
        square = ng.Integrate(ng.InnerProduct(s, grad), mesh.Materials(body.name), order=order)
        norm[body.name] = max(float(square), 0.0) ** 0.5
        work += loads(scene, mesh, u, body, order)
    return Measures(
        norm=norm,
        energy=sum(x**2 for x in norm.values()) / 2 - work,
        force=contact_forces(scene, solution),
        along=_along(scene, solution),
        error=solution.error_estimate,
    )


def _from_start(s: Array, force: Array, at: Array) -> tuple[Array, Array]:
    """Bounds (k,) of the force from the start of a side to `at` (k,).

    Forces at points are integrals of the pressure against weights of a quadrature, and from the
    start to a point the integral lies between the sums without and with the point's own weight:
    the inequalities of Chebyshev, Markov and Stieltjes, for Gauss-Lobatto points.
    """
    total = np.concatenate([[0.0], np.cumsum(force)])
    slack = ALIKE * (np.ptp(s) if len(s) else 0.0)
    last, first = np.searchsorted(s, at + slack, side="right"), np.searchsorted(s, at - slack)
    return total[np.maximum(last - 1, 0)], total[np.minimum(first + 1, len(s))]


def _spread(
    one: Measures, other: Measures, key: tuple[str, int], length: float, joined: bool
) -> float:
    """How far the forces from the start of a side to any of its points are apart, at least.

    Where sides are `joined` without a turn, the point there counts for one of them.
    """
    none = np.zeros(0), np.zeros(0)
    (s, F), (t, G) = one.along.get(key, none), other.along.get(key, none)
    at = np.array([*s, *t])
    at = at[(at > ALIKE * length) & (at < (1 - ALIKE) * length)]  # jumps at the ends
    (low, high), (below, above) = _from_start(s, F, at), _from_start(t, G, at)
    off = float(np.maximum(low - above, below - high).max(initial=0.0))
    off = max(off, float(abs(F.sum() - G.sum())))
    ends = max(float(np.abs(x[[0, -1]]).max()) if len(x) else 0.0 for x in (F, G))
    return max(0.0, off - (2 * ends if joined else 0.0))


def differences(scene: Scene, one: Measures, other: Measures) -> dict[str, float]:
    """How far two solutions are apart, relative to energy norm or largest force.

    "norm": of the energy norms of a body, at most the energy norm of the difference. "energy": root
    of twice the difference of the potential energies. "force": on a body. "spread": of the forces
    from the start of a side to any of its points. Only what both have is compared.
    """
    whole = max(one.whole, other.whole)
    if whole == 0:
        return {}
    found = {f"norm of {b}": abs(x - other.norm[b]) / whole for b, x in one.norm.items()}
    found["energy"] = abs(2 * (one.energy - other.energy)) ** 0.5 / whole
    every = [F for m in (one, other) for F in m.force.values()]
    lines = [F for m in (one, other) for _, F in m.along.values()]
    size = max([*(float(np.hypot(*F)) for F in every), *(float(np.abs(F).sum()) for F in lines)])
    if size == 0:
        return found
    for bodies, F in one.force.items():
        same = [bodies] if bodies in other.force else bodies.split("+")
        if all(body in other.force for body in same):
            there = sum((other.force[body] for body in same), np.zeros(2))
            found[f"force on {bodies}"] = float(np.linalg.norm(F - there)) / size
    if {k for k, _ in one.along} == {k for k, _ in other.along}:
        keys = one.along.keys() | other.along.keys()
        for name, i in keys:
            length = scene.sides[name][i].length
            off = _spread(one, other, (name, i), length, joined=len(keys) > 1)
            found[f"spread on {name}"] = max(found.get(f"spread on {name}", 0.0), off / size)
    return found


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
