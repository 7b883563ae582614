"""The README's example, its table and its commands; test_pages has its links."""

import math
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
    told = re.search(r"pressure (\S+) ends of contact \[\[(\S+) +\S+\]\]", capsys.readouterr().out)
    peak, half_width = map(float, told.groups())
    assert abs(peak / 851e6 - 1) < 0.01
    assert abs(half_width / 0.029 - 1) < 0.01


def test_comparison_is_that_of_the_benchmarks():
    """Rows of the table are those of "the first three" in docs/benchmarks.md, to two digits."""
    full = {}
    for line in (ROOT / "docs" / "benchmarks.md").read_text().splitlines():
        cells = [cell.strip(" *") for cell in line.split("|")[1:-1]]
        if len(cells) == 8 and cells[1] == "the first three":
            full[cells[0], cells[2], cells[3]] = cells[4:]
    names = {
        "ngcontact, which finds the zone itself": ("ngcontact", "adaptive"),
        "active set in NGSolve, uniform meshes": ("NGSolve active set", "uniform"),
        "active set in NGSolve, graded meshes": ("NGSolve active set", "graded"),
        "active set in scikit-fem, graded meshes": ("scikit-fem active set", "graded"),
        "penalty in NGSolve, graded meshes": ("NGSolve penalty", "graded"),
        "mortar in Kratos, graded meshes": ("Kratos mortar", "graded"),
    }
    [table] = re.findall(r"^\| disc / block .*\n\|[-|]+\n((?:\|.*\n)+)", README, re.MULTILINE)
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in table.splitlines()]
    assert [row[0] for row in rows] == list(names)
    for name, *cells in rows:
        for k, problem in enumerate(("disc", "block")):
            for cell, seconds in zip(cells, full[(problem, *names[name])], strict=True):
                assert rounded(cell.split(" / ")[k], seconds), (name, problem, cell)


def rounded(stated, seconds):
    """Whether a figure is another one of two significant digits; "-" is only itself."""
    if "-" in (stated, seconds):
        return stated == seconds
    unit = 10 ** (math.floor(math.log10(float(seconds))) - 1)
    return abs(float(stated) - float(seconds)) < 0.501 * unit


def test_commands_are_targets():
    targets = re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
    commands = re.findall(r"^make (\w+)", README, re.MULTILINE)
    assert commands == ["demo", "test"]
    assert set(commands) <= set(targets)
