"""Contact problems with exact solutions, ready to solve: the cases of the studies and tests.

Every function returns a `Case`. Materials are those of all reference figures: E = 1, nu = 0.3 for
the body ' (upper, outer) and E = 3, nu = 0.2 for the body '' (lower, inner).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import ngsolve as ng
import numpy as np

from drivers.reference.curved import Curved, bearing, curved, rings
from drivers.reference.straight import Exact, hertz, patch, transition, uniform_pressure
from ngcontact import Contact, Elastic, Problem, Solution
from ngcontact.geometries import blocks, disc, disc_on_block, graphs, punch
from ngcontact.geometries import rings as ring_geometry
from ngcontact.geometries.region import RIGHT, UP, body, compound, polygon, quarter_arc, segment

FIRST = Elastic(E=1.0, nu=0.3)
SECOND = Elastic(E=3.0, nu=0.2)
LINE = ((-1.0, 0.0), (-0.4, 0.25), (0.3, -0.2), (1.0, 0.1))  # of a polygonal zone
BLOCKS = {"upper": FIRST, "lower": SECOND}
TOUCHING = Contact(secondary="upper_contact", primary="lower_contact")
UPWARDS = Contact(secondary="lower_contact", primary="upper_contact", direction=(0, 1))
OUTSIDE = {"upper": "top|upper_left|upper_right", "lower": "bottom|lower_left|lower_right"}


@dataclass(frozen=True, eq=False)
class Case:
    """A continuous problem and its exact solution."""

    problem: Problem
    exact: Exact


def _on_outside(exact: Exact) -> dict[str, ng.CoefficientFunction]:
    """Exact displacement on the outer boundary of both blocks."""
    return {OUTSIDE[body]: u for body, u in exact.displacement.items()}


def touching_blocks(displacement: dict[str, Any], **others: Any) -> Problem:
    """Blocks without a gap, of the two materials unless told otherwise."""
    whole = {"geometry": blocks(), "materials": BLOCKS, "contact": [TOUCHING], **others}
    return Problem(displacement=displacement, **whole)


def one_transition(upper: Elastic = FIRST, lower: Elastic = SECOND) -> Case:
    """S1: blocks that part at the origin, pressure (-x)^(1/2), gap x^(3/2); bounded zone."""
    exact, laws = transition(upper, lower), {"upper": upper, "lower": lower}
    return Case(touching_blocks(_on_outside(exact), materials=laws), exact)


def hertz_contact(radius: float = 5.0, half_width: float = 0.3) -> Case:
    """S3: blocks with the gap x^2 / 2R as data, Hertz's pressure; enlarging zone."""
    exact = hertz(FIRST, SECOND, radius=radius, half_width=half_width)
    contact = replace(UPWARDS, gap=exact.initial_gap)
    return Case(touching_blocks(_on_outside(exact), contact=[contact]), exact)


def pressure_patch(p1: float = 0.0) -> Case:
    """S6: full contact under the pressure 1 + p1 x of blocks clamped above and below."""
    exact = patch(FIRST, SECOND, p0=1.0, p1=p1)
    ends = {"top": exact.displacement["upper"], "bottom": exact.displacement["lower"]}
    return Case(touching_blocks(ends), exact)


def polygonal_patch(p: float = 1.0) -> Case:
    """Uniform stress -p I across a zone with a convex and a re-entrant corner, one material."""
    exact = uniform_pressure(FIRST, tuple(BLOCKS), p=p)
    u = exact.displacement["upper"]
    problem = touching_blocks(
        {"top": u, "bottom": u},
        geometry=blocks(line=LINE),
        materials=dict.fromkeys(BLOCKS, FIRST),
        traction={"upper_left|upper_right|lower_left|lower_right": p},
    )
    return Case(problem, exact)


def clamped_transition() -> Case:
    """S7: as S1 with homogeneous data, tractions on the sides, body forces; clamped both ends."""
    exact = transition(FIRST, SECOND, plateau=0.5)
    side = {"left": ng.CF((-1, 0)), "right": ng.CF((1, 0))}
    traction = {
        f"{body}_{name}": stress * normal
        for body, stress in exact.stress.items()
        for name, normal in side.items()
    }
    ends = {"top": (0, 0), "bottom": (0, 0)}
    return Case(touching_blocks(ends, traction=traction, force=exact.force), exact)


def guided_transition() -> Case:
    """S7 as in the paper: Gamma_u above, Gamma_0 below, the lower block free to slide."""
    case = clamped_transition()
    problem = replace(case.problem, displacement={"top": (0, 0)}, sliding="bottom")
    return Case(problem, case.exact)


def curved_lines() -> Case:
    """S8: two parabolas that face each other, tractions along xi; enlarging zone."""
    exact: Curved = curved(FIRST, SECOND)
    geometry = graphs(
        upper=lambda x: float(exact.curve["upper"](x)),
        lower=lambda x: float(exact.curve["lower"](x)),
        a=-0.6,
        b=0.6,
        height=0.6,
    )
    others = {"geometry": geometry, "force": exact.force, "contact": [UPWARDS]}
    return Case(touching_blocks(_on_outside(exact), **others), exact)


def ring_in_ring(qn: float = 0.3, n: int = 2) -> Case:
    """S9: a quarter of concentric rings under 1 + qn cos(n theta), guided on the cuts."""
    exact = rings(FIRST, SECOND, qn=qn, n=n)
    load = 1 + qn * ng.cos(n * ng.atan2(ng.y, ng.x))
    problem = Problem(
        geometry=ring_geometry(quarter=True),
        materials={"outer": FIRST, "inner": SECOND},
        sliding="inner_cut_x|inner_cut_y|outer_cut_x|outer_cut_y",
        traction={"rim": load},
        contact=[Contact(secondary="outer_contact", primary="inner_contact")],
    )
    return Case(problem, exact)


def ring_in_bearing(outer: float = 1.0) -> Case:
    """A quarter of a ring, pressed inside by 1 + 0.6 cos(2 theta), in a rigid bearing.

    Guided on the cuts and on the curved rim.
    """
    hole = outer / 2
    edges = [
        ("cut_y", segment((hole, 0.0), (outer, 0.0))),
        ("rim", quarter_arc((0.0, 0.0), outer, RIGHT, UP)),
        ("cut_x", segment((0.0, outer), (0.0, hole))),
        ("hole", quarter_arc((0.0, 0.0), hole, UP, RIGHT)),
    ]
    problem = Problem(
        geometry=compound(body("ring", edges)),
        materials={"ring": FIRST},
        sliding="cut_x|cut_y|rim",
        traction={"hole": 1 + 0.6 * ng.cos(2 * ng.atan2(ng.y, ng.x))},
    )
    return Case(problem, bearing(FIRST, radii=(hole, outer)))


def flat_punch() -> Problem:
    """Block a million times stiffer than the foundation it is pressed into: r^(-1/2) at corners."""
    return Problem(
        geometry=punch(),
        materials={"punch": Elastic(E=1e6, nu=0.3), "foundation": FIRST},
        displacement={"foundation_bottom": (0, 0), "punch_top": (0, -0.01)},
        contact=[Contact(secondary="punch_contact", primary="foundation_contact")],
    )


def pressed_disc() -> Problem:
    """Disc on a block, both free to find their contact zone; a/R = 0.03."""
    return Problem(
        geometry=disc_on_block(),
        materials={"disc": FIRST, "block": SECOND},
        displacement={"block_bottom": (0, 0), "disc_top": (0, -0.002)},
        sliding="axis",
        contact=[Contact(secondary="disc_arc", primary="block_top", direction=(0, -1))],
    )


def disc_on_rigid_plane() -> Problem:
    """Problem A: quarter disc pressed by 0.005 R on a rigid plane; E = 200, nu = 0.3.

    References: contact force of the whole disc 0.4465326(2), peak pressure 5.5919(1), half-width
    0.05082(1), strain energy of the half 5.221032(1)e-4.
    """
    return Problem(
        geometry=disc(),
        materials={"disc": Elastic(E=200.0, nu=0.3)},
        displacement={"top": (None, -0.005)},
        sliding="axis",
        contact=[Contact(secondary="arc", direction=(0, -1), gap=ng.y)],
    )


def partly_opening_block() -> Problem:
    """Problem B: a block pressed on a clamped one over half its width; the other half lifts off.

    E = 1000, nu = 0.3, pressure 1 on 0 <= x <= 1 of the top of the upper block. Boundaries are
    those of `geometries.blocks`, but for ``pressed``, the loaded half of the top, and
    ``upper_axis`` and ``lower_axis``, x = 0.
    """
    upper = polygon(
        [(0, 0), (2, 0), (2, 1), (1, 1), (0, 1)],
        ["upper_contact", "upper_right", "top", "pressed", "upper_axis"],
    )
    lower = polygon(
        [(0, 0), (0, -1), (2, -1), (2, 0)],
        ["lower_axis", "bottom", "lower_right", "lower_contact"],
    )
    return Problem(
        geometry=compound(body("upper", upper), body("lower", lower)),
        materials={"upper|lower": Elastic(E=1000.0, nu=0.3)},
        displacement={"bottom": (0, 0)},
        sliding="upper_axis|lower_axis",
        traction={"pressed": 1.0},
        contact=[TOUCHING],
    )


def harmonics(solution: Solution, radius: float, n: int) -> tuple[float, float]:
    """Mean P0 and amplitude Pn of cos(n theta), n even, of the pressure on a quarter circle.

    From the nodal forces: the sums of force and of force times cos(n theta) stand for the
    integrals of p and of p cos(n theta) over the arc.
    """
    theta = np.arctan2(solution.points[:, 1], solution.points[:, 0])
    arc = radius * math.pi / 2
    mean = solution.force.sum() / arc
    amplitude = 2 * (solution.force * np.cos(n * theta)).sum() / arc
    return float(mean), float(amplitude)
