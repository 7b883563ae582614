"""Tables of rows of one kind: printed as they come, in Markdown, in a file.

Columns map titles to entries: a format of the row, as "{0.unknowns:d}", or a function of it. Where
they are printed a column is as wide as its title.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

Q = TypeVar("Q")
Columns: TypeAlias = Mapping[str, str | Callable[[Any], str]]


def entries(columns: Columns, row: object) -> list[str]:
    """The cells of a row."""
    return [form.format(row) if isinstance(form, str) else form(row) for form in columns.values()]


def line(columns: Columns, row: object) -> str:
    """One line of a printed table, whose head is the titles with two blanks between them."""
    cells = zip(columns, entries(columns, row), strict=True)
    return "  ".join(f"{cell:>{len(title)}}" for title, cell in cells)


def printed(columns: Columns, rows: Iterable[Q]) -> list[Q]:
    """Print a table line by line as rows come, and return them."""
    print("  ".join(columns))
    found = []
    for row in rows:
        found.append(row)
        print(line(columns, row), flush=True)
    return found


def table(titles: Iterable[str], rows: Iterable[Sequence[object]]) -> str:
    """Markdown table of the strings of all cells, as the pages of docs/ have them."""
    titles = list(titles)
    lines = [titles, ["---"] * len(titles), *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines)


def of_dicts(rows: Sequence[Mapping[str, object]]) -> str:
    """Markdown table of rows whose keys are the titles."""
    return table(rows[0], [list(row.values()) for row in rows])


def markdown(columns: Columns, rows: Iterable[object]) -> str:
    """Markdown table of rows."""
    return table(columns, [entries(columns, row) for row in rows])


def write_csv(path: Path, rows: Sequence[Any]) -> None:
    """A file with one line a row: dicts, or dataclasses."""
    found = [row if isinstance(row, dict) else asdict(row) for row in rows]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, fieldnames=list(found[0]))
        writer.writeheader()
        writer.writerows(found)
