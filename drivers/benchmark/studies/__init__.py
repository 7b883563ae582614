"""What is measured, one study a module: rows of all problems, orders and sizes, and their table."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

from drivers.benchmark.scenes.problems import COMMONS, Common, Name


@dataclass(frozen=True)
class Extent:
    """How much is measured; see `main`."""

    problems: Sequence[Name]
    rounds: int
    max_dofs: int

    def cases(
        self, orders: Sequence[int], sizes: Sequence[int]
    ) -> Iterator[tuple[Common, int, int]]:
        """Problems, orders and numbers of unknowns up to about `max_dofs`."""
        for name in self.problems:
            wanted = [size for size in sizes if size <= self.max_dofs]
            yield from product([COMMONS[name]()], orders, wanted)
