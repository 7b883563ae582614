"""Bodies bounded by the graphs of functions."""

from __future__ import annotations

from collections.abc import Callable

from netgen.occ import OCCGeometry

from ngcontact.geometries.check import above, count, finite, positive
from ngcontact.geometries.graph_edge import GraphCurve, follow
from ngcontact.geometries.region import body, compound, segment


def graphs(
    upper: Callable[[float], float],
    lower: Callable[[float], float],
    a: float = -1.0,
    b: float = 1.0,
    height: float = 1.0,
    samples: int = 261,
) -> OCCGeometry:
    """Two bodies that face each other along the graphs of two functions.

    The upper curve is f' of HH81, the lower one f'', with x for eta and y for xi (HH81 section 2,
    the enlarging zone). The gap f' - f'' may vanish, and be negative where the bodies overlap.
    Lengths are in any consistent unit.

    Parameters
    ----------
    upper : callable
        Lower side of the upper body, y as a function of x, called with one number at a time.
    lower : callable
        The same of the upper side of the lower body.
    a : float
        Left end: the bodies cover `a` <= x <= `b`.
    b : float
        Right end.
    height : float
        The bodies reach to y = `height` and y = -`height`.
    samples : int
        Points of each graph for a quintic spline, at least 16; degrees up to 8 are exact anyway.

    Returns
    -------
    OCCGeometry
        Compound of the two bodies. x is linear in the parameter of the contact edges.

    Raises
    ------
    TypeError
        If `upper` or `lower` is not a function from number to number, `samples` no whole number.
    ValueError
        If `b` does not exceed `a`, a graph leaves -`height` < y < `height`, or `samples` points do
        not resolve it to 1e-4 of its departure from a straight line.

    Notes
    -----
    ====================  ==================================================
    body, boundary        where
    ====================  ==================================================
    ``upper``             upper(x) <= y <= `height`
    ``lower``             -`height` <= y <= lower(x)

    ``upper_contact``     y = upper(x)
    ``lower_contact``     y = lower(x)
    ``top``               y = `height`
    ``bottom``            y = -`height`
    ``upper_left``        x = `a`, ``upper``
    ``upper_right``       x = `b`, ``upper``
    ``lower_left``        x = `a`, ``lower``
    ``lower_right``       x = `b`, ``lower``
    ====================  ==================================================
    """
    a = finite("a", a)
    b, height = above("b", b, "a", a), positive("height", height)
    over = _curve("upper", upper, a, b, height, samples)
    under = _curve("lower", lower, a, b, height, samples)
    upper_outline = [
        ("upper_contact", over.edge()),
        ("upper_right", segment(over.right, (b, height))),
        ("top", segment((b, height), (a, height))),
        ("upper_left", segment((a, height), over.left)),
    ]
    lower_outline = [
        ("lower_contact", under.edge(leftward=True)),
        ("lower_left", segment(under.left, (a, -height))),
        ("bottom", segment((a, -height), (b, -height))),
        ("lower_right", segment((b, -height), under.right)),
    ]
    return compound(body("upper", upper_outline), body("lower", lower_outline))


def _curve(
    name: str, f: Callable[[float], float], a: float, b: float, height: float, samples: int
) -> GraphCurve:
    """Curve along a graph, refused where it leaves -`height` < y < `height`."""
    if not callable(f):
        raise TypeError(f"{name} = {f!r}: expected a function of one number x")
    curve = follow(name, f, a, b, count("samples", samples, 16))
    if not -height < curve.lowest <= curve.highest < height:
        raise ValueError(
            f"{name}: values from {curve.lowest!r} to {curve.highest!r}: expected values "
            f"strictly between -height = {-height!r} and height = {height!r}"
        )
    return curve
