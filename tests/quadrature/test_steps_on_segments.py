"""Jumps along segments are told from what is only steep."""

from __future__ import annotations

import numpy as np
import pytest

from ngcontact.quadrature import steps_on

SEGMENTS = np.array([3, 5, 6])


def on_line(function):
    """The function of segment + s."""
    return lambda segment, s: function(segment + s)


@pytest.mark.parametrize("place", [3.0, 5.0, 5.2, 5.25, 5.7071, 5.999999])
def test_jumps_are_found_where_they_are(place):
    at, s, _ = steps_on(on_line(lambda x: np.cos(x) + 1e-3 * (x > place)), SEGMENTS)
    assert at.tolist() == [int(place)]
    assert s[0] == pytest.approx(place - at[0], abs=1e-11)


def test_jumps_at_an_end_are_seen_from_their_side():
    at, s, _ = steps_on(on_line(lambda x: np.where(x >= 6.0, 1.0, 0.0)), SEGMENTS)
    assert at.tolist() == [5]
    assert s[0] == pytest.approx(1.0, abs=1e-11)


@pytest.mark.parametrize(
    "smooth",
    [
        np.zeros_like,
        np.cos,
        lambda x: np.abs(x - 5.3),
        lambda x: np.sqrt(np.maximum(x - 5.3, 0)),
        lambda x: np.maximum(x - 5.3, 0) ** 0.1,
        lambda x: np.arctan(1e6 * (x - 5.3)),
    ],
    ids=["zero", "smooth", "kink", "root", "tenth root", "steep"],
)
def test_what_is_continuous_does_not_jump(smooth):
    assert steps_on(on_line(smooth), SEGMENTS)[0].size == 0


@pytest.mark.parametrize("scale", [1e-12, 1e12])
def test_jumps_scale(scale):
    at, *_ = steps_on(on_line(lambda x: scale * (x + (x > 5.3))), SEGMENTS)
    assert at.tolist() == [5]


@pytest.mark.parametrize("segments", [1, 40, 3000])
@pytest.mark.parametrize("size", [1.0, 1e-3])
def test_jumps_are_found_on_any_number_of_segments(segments, size):
    """Of 1e-3 beside a change of 1, which in 2048 parts bends by 1e-6 from one to the next."""
    place = 0.70710678 * segments
    wave = on_line(lambda x: np.sin(3 * x / segments) + size * (x > place))
    at, s, largest = steps_on(wave, np.arange(segments))
    assert at.tolist() == [int(place)]
    assert at[0] + s[0] == pytest.approx(place, abs=1e-9)
    assert largest == pytest.approx(1.0 + size * (place > np.pi / 6 * segments), rel=0.3)


@pytest.mark.parametrize("segments", [1, 40, 400, 3000])
def test_smooth_functions_are_looked_at_once(segments):
    """At 2048 places, 5 a segment at least; where their slope is extreme, more closely."""
    seen = []

    def values(segment, s):
        seen.append(len(s))
        return np.sin(3 * (segment + s) / segments)

    assert steps_on(values, np.arange(segments))[0].size == 0
    assert sum(seen) <= 1.2 * max(2048, 5 * segments)  # measured 1.0
