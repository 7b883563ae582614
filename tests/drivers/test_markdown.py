"""Tables as the pages have them."""

from __future__ import annotations

from drivers.markdown import table


def test_a_table_has_a_line_a_row():
    found = table(("order", "error"), [(1, "2e-2"), (2, "1e-3")])
    assert found == "| order | error |\n| --- | --- |\n| 1 | 2e-2 |\n| 2 | 1e-3 |"
    assert table(("order",), []) == "| order |\n| --- |"
