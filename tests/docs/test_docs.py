"""The README's example and its commands; test_pages has its links."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()


def test_example_runs(tmp_path, monkeypatch, capsys):
    [code] = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    assert len([line for line in code.splitlines() if line.strip()]) <= 15
    monkeypatch.chdir(tmp_path)
    exec(compile(code, "README.md", "exec"), {})
    assert (tmp_path / "hertz.vtu").exists()
    # Hertz at the force of that press: half-width 0.029 R, peak pressure 851 MPa, see the demo.
    peak, half_width = map(
        float, re.search(r"pressure (\S+) half-width (\S+)", capsys.readouterr().out).groups()
    )
    assert abs(peak / 851e6 - 1) < 0.01
    assert abs(half_width / 0.029 - 1) < 0.01


def test_commands_are_targets():
    targets = re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
    commands = re.findall(r"^make (\w+)", README, re.MULTILINE)
    assert commands == ["demo", "test"]
    assert set(commands) <= set(targets)
