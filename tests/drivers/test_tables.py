"""What the demonstrations print."""

from drivers.tables import last_level, table
from ngcontact import Contact, Elastic, Problem, solve
from ngcontact.geometries import blocks


def test_levels_are_printed_as_they_are_and_the_last_one_is_returned(capsys):
    problem = Problem(
        geometry=blocks(),
        materials={"upper|lower": Elastic(E=1.0, nu=0.3)},
        displacement={"bottom": (0, 0), "top": (0, -0.01)},
        contact=[Contact(secondary="upper_contact", primary="lower_contact")],
    )
    levels = [solve(problem, maxh=h) for h in (1.0, 0.5)]
    columns = {" force": lambda force: f"{force:.3f}", "in mN": lambda force: f"{1e3 * force:.0f}"}
    last, force = last_level(levels, lambda level: level.contact_force()[1], columns)
    assert last is levels[1]
    assert force == last.contact_force()[1]
    head, *rows = capsys.readouterr().out.splitlines()
    assert head.split()[-4:] == ["force", "in", "mN", "seconds"]
    for level, row in zip(levels, rows, strict=True):
        pushed = level.contact_force()[1]
        assert len(row) == len(head)
        assert row.split()[0] == str(level.displacement.space.ndof)
        assert row.split()[4:6] == [f"{pushed:.3f}", f"{1e3 * pushed:.0f}"]


def test_a_table_has_a_line_a_row():
    found = table(("order", "error"), [(1, "2e-2"), (2, "1e-3")])
    assert found == "| order | error |\n| --- | --- |\n| 1 | 2e-2 |\n| 2 | 1e-3 |"
    assert table(("order",), []) == "| order |\n| --- |"
