"""README and pages: the examples run, and what they name exists."""

import math
import re
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

from drivers.__main__ import drivers
from tests.docs.pages import resolved

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


TEXTS = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
PAGES = {path.relative_to(ROOT).as_posix(): path.read_text() for path in TEXTS}
CODE = re.compile(r"```.*?```|`([^`\n]+)`", re.DOTALL)
CURRENT = sorted(PAGES.keys() - {"CHANGELOG.md"})  # which names what was, too


def exists(name):
    """Whether a dotted name leads to something of ngcontact; `solution.x` may be a Solution's."""
    try:
        resolved(name)
    except AttributeError:
        return name.startswith("solution.") and exists(name.replace("solution", "Solution", 1))
    return True


def dotted(text):
    """Names below a room or a class at the top: `fem.space.Space`, `Solution.points`."""
    words = [match.group(1) or "" for match in CODE.finditer(text)]
    found = [re.match(r"(?:ngcontact\.)?(\w+)((?:\.\w+)+)(?=[\[(]|$)", word) for word in words]
    names = [(match.group(1), match.group(1) + match.group(2)) for match in found if match]
    return [name for first, name in names if find_spec(f"ngcontact.{first}") or first == "Solution"]


def test_names_of_the_package_exist():
    assert dotted("`fem.space.Space`, `x.y` and `os.path`: `qp`") == ["fem.space.Space"]
    assert not exists("solution.pints")
    names = {name for page in CURRENT for name in dotted(PAGES[page])}
    assert not [name for name in names if not exists(name)]


def test_modules_of_the_theory_exist_and_every_room_is_there():
    theory = PAGES["docs/theory.md"]
    [table] = re.findall(r"^\| where \| contents \|\n(.*?)\n\n", theory, re.M | re.S)
    cells = [row.split("|")[1] for row in table.splitlines()[1:]]
    modules = [name for cell in cells for name in re.findall(r"`([\w.]+)`", cell)]
    assert len(modules) > 30
    for module in modules:
        import_module(f"ngcontact.{module}")
    rooms = {name.split(".")[0] for name in re.findall(r"`([\w.]+)`", theory)}
    packages = {path.parent.name for path in (ROOT / "ngcontact").glob("*/__init__.py")}
    assert packages - {"geometries"} <= rooms


def test_files_drivers_and_links_exist():
    for page in CURRENT:
        files = re.findall(
            r"(?<![\w/])(?:(?:ngcontact|docs|drivers|geometries|tests)/[\w/]+\.py)", PAGES[page]
        )
        assert not [file for file in files if not (ROOT / file).exists()], page
        modules = re.findall(r"python -m (drivers[\w.]*\w)", PAGES[page])
        assert not [module for module in modules if find_spec(module) is None], page
    for page, text in PAGES.items():
        links = re.findall(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)", text)
        assert not [x for x in links if not (ROOT / page).parent.joinpath(x).exists()], page


def test_pages_have_all_drivers_and_words_of_machine_design():
    """What a reader types into the search stands on a page, with a link or an answer beside it."""
    page, limits = PAGES["docs/gallery/drivers.md"], PAGES["docs/topics/limits.md"]
    assert not [name for name in drivers() if f"`python -m drivers.{name}`" not in page]
    words = ("thermal", "bolt", "seal", "press fit", "bearing")
    assert not [word for word in words if f"**{word}**" not in limits]
