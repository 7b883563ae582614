"""The measurements as Markdown tables."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from drivers.benchmark.studies.accuracy import (
    OURS,
    TOGETHER,
    TOLERANCES,
    Point,
    best_seconds,
    series,
)
from drivers.benchmark.studies.growth import Growth
from drivers.benchmark.studies.large import Large
from drivers.benchmark.studies.levels import Level
from drivers.benchmark.studies.skip import Scene
from drivers.benchmark.studies.stages import Stages
from drivers.benchmark.studies.tax import Tax
from drivers.markdown import table


def seconds(value: float) -> str:
    """Two or three digits; a dash where there is no time."""
    return "-" if math.isinf(value) else f"{value:.3g}" if value < 100 else f"{value:.0f}"


def of_tax(rows: Iterable[Tax]) -> str:
    """Contact tax."""
    titles = ("problem", "order", "unknowns", "linear, s", "cold", "warm", "systems", "factors")
    return table(
        titles,
        (
            (
                *(r.problem, r.order, r.unknowns, seconds(r.linear)),
                *(f"{r.cold:.2f}", f"{r.warm:.2f}"),
                *(f"{a}, {b}" for a, b in (r.systems, r.factorizations)),
            )
            for r in rows
        ),
    )


def of_levels(rows: Iterable[Level]) -> str:
    """Whole adaptive levels."""
    return table(
        ("problem", "order", "unknowns", "level, s", "over linear"),
        ((r.problem, r.order, r.unknowns, seconds(r.seconds), f"{r.ratio:.2f}") for r in rows),
    )


def of_growth(rows: Sequence[Growth]) -> str:
    """Exponents of time and ratios of memory."""
    lines = []
    for key in dict.fromkeys((r.problem, r.order) for r in rows):
        linear, contact = (
            [r for r in rows if (r.problem, r.order) == key and r.kind == kind]
            for kind in ("linear", "contact")
        )
        for one, other in zip(linear, contact, strict=True):
            ratios = (other.seconds / one.seconds, other.memory / one.memory)
            lines.append(
                (
                    *key,
                    one.unknowns,
                    *(seconds(r.seconds) for r in (one, other)),
                    *(f"{r.memory:.2f}" for r in (one, other)),
                    *(f"{ratio:.2f}" for ratio in ratios),
                )
            )
        if len(linear) < 2:
            continue
        exponents = [
            np.polyfit(np.log([r.unknowns for r in x]), np.log([r.seconds for r in x]), 1)[0]
            for x in (linear, contact)
        ]
        lines.append((*key, "exponent", *(f"{e:.2f}" for e in exponents), "", "", "", ""))
    titles = ("problem", "order", "unknowns", "linear, s", "contact, s", "linear, GB")
    return table((*titles, "contact, GB", "time", "memory"), lines)


def of_large(rows: Sequence[Large]) -> str:
    """Direct and iterative beside each other."""
    direct, iterative = ([r for r in rows if r.path == path] for path in ("direct", "iterative"))
    titles = ("problem", "order", "unknowns", "direct, s", "iterative, s", "direct, GB")
    return table(
        (*titles, "iterative, GB", "systems", "V-cycles"),
        (
            (
                *(d.problem, d.order, d.unknowns, seconds(d.seconds), seconds(i.seconds)),
                *(f"{d.memory:.2f}", f"{i.memory:.2f}", i.systems, i.cycles),
            )
            for d, i in zip(direct, iterative, strict=True)
        ),
    )


def of_accuracy(found: Sequence[Point]) -> str:
    """Seconds of each engine's best order to relative errors."""
    lines = []
    measures = [(name,) for name in ("force", "peak", "half_width", "energy")] + [TOGETHER]
    for problem in dict.fromkeys(p.problem for p in found):
        mine = [p for p in found if p.problem == problem]
        for names in measures:
            title = "the first three" if names == TOGETHER else names[0].replace("_", "-")
            for engine, kind in series(mine):
                times = [best_seconds(mine, engine, kind, names, t) for t in TOLERANCES]
                label = f"**{engine}**" if engine == OURS else engine
                lines.append((problem, title, label, kind, *map(seconds, times)))
    return table(
        ("problem", "quantity", "engine", "meshes", *(f"{t:.0e}" for t in TOLERANCES)), lines
    )


def of_scenes(rows: Iterable[Scene]) -> str:
    """What scenes skip."""
    rows = list(rows)
    counts = list(rows[0].work)
    return table(
        ("feature", "scene", "unknowns", "systems", *(c.replace("_", " ") for c in counts), "s"),
        (
            (r.feature, r.variant, r.unknowns, r.systems, *r.work.values(), seconds(r.seconds))
            for r in rows
        ),
    )


def of_stages(rows: Iterable[Stages]) -> str:
    """Where the time goes, seconds and shares."""
    rows = list(rows)
    names = list(rows[0].seconds)
    lines = []
    for r in rows:
        total = sum(r.seconds.values())
        shares = (f"{100 * r.seconds[name] / total:.0f} %" for name in names)
        lines.append((r.problem, r.unknowns, seconds(total), *shares))
    return table(("problem", "unknowns", "level, s", *names), lines)
