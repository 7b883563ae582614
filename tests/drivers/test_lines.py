"""Contact lines: corners, where they end, and how often contact begins and ends on them.

What happens at corners where contact ends is in tests/contact/test_state.py.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import ngsolve as ng
import numpy as np
import pytest
from netgen.occ import OCCGeometry

from drivers.reference import cases
from drivers.reference.straight import patch, relative_energy_error
from drivers.reference.westergaard import effective_modulus, moduli
from drivers.stress import Outcome
from ngcontact import Contact, Problem, adapt, solve
from ngcontact.geometries import blocks
from tests.drivers.test_shapes import solved, structured

TURNS = (1e-9, 1e-6, 1e-4, 4e-4, 6e-4, 1e-3, 1e-2, 0.1, 1.0)
PATCH = 1e-9  # of exactly represented stresses, resultants and pressures
RIGHT = 0.73  # extent of the line right of its corner; 1 to the left, so that segments differ

WAVES = (1, 8, 64)
AMPLITUDE = 0.01  # of a wave, in wavelengths
# Half-widths of the contact on one crest, in wavelengths; the second at 0.9 of the load that
# closes all.
HALF_WIDTHS = {"light": 0.1, "heavy": math.asin(math.sqrt(0.9)) / math.pi}
NODES = 16  # segments in a wavelength


def uniform_stress() -> Iterator[Outcome]:
    """The stress -I across lines with one corner: displacement, resultant and pressure."""
    template = cases.polygonal_patch()
    exact = template.exact.displacement["upper"]
    for turn in (sign * size for size in TURNS for sign in (1, -1)):
        slope = math.tan(turn / 2)
        line = [(-1.0, -slope), (0.0, 0.0), (RIGHT, -RIGHT * slope)]
        problem = replace(template.problem, geometry=blocks(line=line))
        resultant = np.array([(RIGHT - 1) * slope, 1 + RIGHT])
        for order in (1, 2):
            s = solve(problem, maxh=0.4, order=order)
            fields = (s.displacement - exact, exact)
            off, size = (ng.Integrate(ng.InnerProduct(v, v), s.mesh) ** 0.5 for v in fields)
            force = np.abs(s.contact_force() - resultant).max()
            error = max(off / size, force, np.abs(s.pressure - 1).max())
            varied = f"turn {turn:g} rad, order {order}"
            yield solved("stress -I across a corner", varied, s, error, PATCH)


def ends_of_the_line() -> Iterator[Outcome]:
    """Contact up to free, prescribed and guided sides of the bodies, exact at every order."""
    free = patch(cases.FIRST, cases.SECOND)
    ends = {"top": free.displacement["upper"], "bottom": free.displacement["lower"]}
    prescribed = {cases.OUTSIDE[body]: u for body, u in free.displacement.items()}
    left, right = "upper_left|lower_left", "upper_right|lower_right"
    squeezed, held = {}, {}
    for (body, material), end in zip(cases.BLOCKS.items(), ("top", "bottom"), strict=True):
        m = moduli(material)
        stiff = m.lam + 2 * m.mu
        held[end] = (None, -ng.y / stiff)
        squeezed[body] = ng.CF((-m.lam / stiff, 0, 0, -1), dims=(2, 2))
    guided = replace(free, stress=squeezed)
    for where, exact, displacement, sliding in (
        ("free sides", free, ends, None),
        ("Gamma_u", free, prescribed, None),
        ("Gamma_0", guided, held, f"{left}|{right}"),
        ("Gamma_u and Gamma_0", guided, held | {left: (0, None)}, right),
    ):
        problem = replace(
            cases.pressure_patch().problem, displacement=displacement, sliding=sliding
        )
        for order in (1, 2, 3):
            s = solve(problem, maxh=0.25, order=order)
            error = max(relative_energy_error(s, exact), np.abs(s.pressure - 1).max())
            yield solved(f"contact up to {where}", f"order {order}", s, error, PATCH)


def wavy(
    waves: int, height: float, crest_at_ends: bool, geometry: ng.Mesh | OCCGeometry, half: float
) -> tuple[Problem, float]:
    """Blocks 0 <= x <= 1 with a wavy gap, guided on the sides, and the mean pressure expected.

    Contact on a crest has the half-width a, `half` of a wavelength. H. M. Westergaard 1939: with
    q = sin^2(pi a / wavelength) the mean pressure is q p*,
    p* = pi E* amplitude / wavelength, for the gap amplitude (1 - cos). Contact closes the mean gap
    by amplitude (q - q ln q): the integral of its derivative -amplitude ln q, the compliance of
    the row of contacts.
    """
    amplitude = AMPLITUDE / waves
    q = math.sin(math.pi * half) ** 2
    mean = q * math.pi * effective_modulus(cases.FIRST, cases.SECOND) * AMPLITUDE
    compliance = sum(height / (m.lam + 2 * m.mu) for m in map(moduli, cases.BLOCKS.values()))
    depth = mean * compliance + amplitude * (q - q * math.log(q))
    wave = ng.cos(2 * math.pi * waves * ng.x)
    gap = amplitude * (1 - wave if crest_at_ends else 1 + wave)
    problem = Problem(
        geometry=geometry,
        materials=cases.BLOCKS,
        displacement={"top": (None, -depth), "bottom": (None, 0)},
        sliding="upper_left|upper_right|lower_left|lower_right",
        contact=[Contact("upper_contact", "lower_contact", direction=(0, -1), gap=gap)],
    )
    return problem, mean


def crests() -> Iterator[Outcome]:
    """All ends of contact on 1, 8 and 64 crests, their places, and the mean pressure."""
    for load, waves, crest_at_ends in (
        (load, waves, ends) for load in HALF_WIDTHS for waves in WAVES for ends in (True, False)
    ):
        half, height = HALF_WIDTHS[load], 2 / waves  # Westergaard's field has decayed to 1e-4
        y = [0.0]  # as close as the nodes at the contact, half as many in every 1.5
        while y[-1] < height:
            y.append(y[-1] + max(1 / (waves * NODES), y[-1] / 2))
        x = np.linspace(0, 1, waves * NODES + 1)
        mesh = structured(x, np.array(y) * height / y[-1])
        problem, mean = wavy(waves, height, crest_at_ends, mesh, half)
        s = solve(problem, order=2)
        places = s.transitions()[:, 0]
        varied = f"{waves} waves, {'crests' if crest_at_ends else 'troughs'} at the sides"
        missed = abs(len(places) - 2 * waves)
        yield solved(f"{load} waves: number of ends", varied, s, missed, 0)
        crests = (np.arange(waves + 1) - (0 if crest_at_ends else 0.5)) / waves
        found = np.abs(places[:, None] - crests).min(axis=1) * waves
        error = np.abs(found / half - 1).max()
        # Ends lie up to a ninth of a segment off: 1.7e-2 measured for both loads.
        yield solved(f"{load} waves: half-width", varied, s, error, 0.03)
        error = abs(np.abs(s.contact_force()[1]) / mean - 1)
        # Three elements in contact on a light crest: 2.2e-3 measured; 8e-5 on a heavy one.
        yield solved(f"{load} waves: mean pressure", varied, s, error, 5e-3)


def adaptive() -> Iterator[Outcome]:
    """Waves that the first mesh does not see: `adapt` finds all of them."""
    for waves, maxh, order, most in ((8, 0.3, 4, 15_000), (64, 0.1, 2, 20_000)):
        geometry = blocks(line=((0, 0), (1, 0)), height=0.5)
        problem, mean = wavy(waves, 0.5, True, geometry, HALF_WIDTHS["light"])
        levels = list(adapt(problem, maxh=maxh, order=order, max_dofs=most))
        s = levels[-1]
        varied = f"{waves} waves from {len(levels[0].points)} points, order {order}"
        missed = abs(len(s.transitions()) - 2 * waves)
        yield solved("adapt: number of ends", varied, s, missed, 0)
        error = abs(np.abs(s.contact_force()[1]) / mean - 1)
        # 1e-3 and 2e-3 measured at these numbers of unknowns.
        yield solved("adapt: mean pressure", varied, s, error, 1e-2)


@pytest.mark.study(witness=["ends_of_the_line"])
@pytest.mark.parametrize("trial", [uniform_stress, ends_of_the_line, crests, adaptive])
def test_nothing_fails(trial):
    found = list(trial())
    assert found
    assert [outcome for outcome in found if not outcome.passed] == []
