"""Bodies bounded by the graphs of functions."""

from __future__ import annotations

from collections.abc import Callable

from netgen.occ import OCCGeometry

from ngcontact.geometries.check import above, count, finite, positive
from ngcontact.geometries.graph_edge import follow
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
    upper, lower : callable
        y as a function of x, called with one number at a time.
    a, b : float
        The bodies cover `a` <= x <= `b`.
    height : float
        The bodies reach to y = `height` and y = -`height`.
    samples : int
        Number of points of each graph that the quintic spline interpolates, at least 16.
        A polynomial of degree 8 or less is exact at any number.

    Returns
    -------
    OCCGeometry
        Compound of the two bodies. x is linear in the parameter of the contact edges.

    Raises
    ------
    TypeError
        If `upper` or `lower` is not a function from number to number, `samples` no whole number.
    ValueError
        If `b` does not exceed `a`, a graph does not stay strictly between y = -`height` and
        y = `height`, or `samples` points do not resolve it to 1e-4 of its departure
        from a straight line.

    Notes
    -----
    ====================  ==================================================
    body                  where
    ====================  ==================================================
    ``upper``             upper(x) <= y <= `height`
    ``lower``             -`height` <= y <= lower(x)
    ====================  ==================================================

    ====================  ==================================================
    boundary              where
    ====================  ==================================================
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
    for name, f in (("upper", upper), ("lower", lower)):
        if not callable(f):
            raise TypeError(f"{name} = {f!r}: expected a function of one number x")
    a = finite("a", a)
    b = above("b", b, "a", a)
    height = positive("height", height)
    samples = count("samples", samples, 16)
    over, under = follow("upper", upper, a, b, samples), follow("lower", lower, a, b, samples)
    for name, curve in (("upper", over), ("lower", under)):
        if not -height < curve.lowest <= curve.highest < height:
            raise ValueError(
                f"{name}: values from {curve.lowest!r} to {curve.highest!r}: expected values "
                f"strictly between -height = {-height!r} and height = {height!r}"
            )
    top = body(
        "upper",
        [
            ("upper_contact", over.edge()),
            ("upper_right", segment(over.right, (b, height))),
            ("top", segment((b, height), (a, height))),
            ("upper_left", segment((a, height), over.left)),
        ],
    )
    bottom = body(
        "lower",
        [
            ("lower_contact", under.edge(leftward=True)),
            ("lower_left", segment(under.left, (a, -height))),
            ("bottom", segment((a, -height), (b, -height))),
            ("lower_right", segment((b, -height), under.right)),
        ],
    )
    return compound(top, bottom)
