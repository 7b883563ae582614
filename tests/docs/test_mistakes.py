"""Every mistake of docs/mistakes.md is refused with its message, before any work."""

import re
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

PAGE = (Path(__file__).parents[2] / "docs" / "mistakes.md").read_text()
ROWS = re.findall(r"^\| `(.+?)` \| (.+?) \| (.+?) \|$", PAGE, re.MULTILINE)


@pytest.fixture(scope="module")
def names():
    [code] = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    found: dict = {}
    exec(compile(code, "docs/mistakes.md", "exec"), found)
    return found


def test_at_least_twenty_are_listed():
    assert len(ROWS) >= 20
    assert len({code for code, _, _ in ROWS}) == len(ROWS)


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize(("code", "message"), [row[:2] for row in ROWS], ids=[r[0] for r in ROWS])
def test_each_is_refused_before_any_work(code, message, names):
    with pytest.raises((ValueError, TypeError)) as refused:
        exec(code, dict(names))
    assert message in str(refused.value)


def test_the_scene_itself_is_right(names):
    """So that what is refused is the mistake; and numbers of other kinds are none."""
    one = names["solve"](names["scene"], order=2, maxh=Fraction(1, 2))
    other = names["solve"](names["scene"], order=np.int64(2), maxh=np.float64(0.5))
    assert one.order == other.order == 2
    assert one.contact_force() == pytest.approx(other.contact_force(), rel=1e-12)
    assert one.contact_force()[1] > 0
