"""The blocks of docs/results.md run one after the other."""

import re
from pathlib import Path

import numpy as np
import pytest

PAGE = (Path(__file__).parents[2] / "docs" / "results.md").read_text()


def test_blocks_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    for block in re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL):
        exec(compile(block, "docs/results.md", "exec"), names)
    assert names["values"].body.tolist() == ["block", "disc"]
    assert names["picture"].shape == (80, 50)
    outside = np.isnan(names["picture"])
    x, y = np.moveaxis(names["grid"], -1, 0)
    np.testing.assert_array_equal(outside, (y > 0) & (x**2 + (y - 1) ** 2 > 1))
    below = names["below"]
    assert below.stress[-1, 1, 1] == pytest.approx(-names["solution"].pressure.max(), rel=0.2)
