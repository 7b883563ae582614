"""A solution as a row of a table, in one line, in a notebook, and in a file that survives.

Kept are the data, the mesh, the displacement and all arrays of contact; the stiffness is assembled
again, and factorised when it is next needed.
"""

from __future__ import annotations

import gzip
import math
import os
import pickle
from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import ngsolve as ng
import numpy as np

from ..discrete import reassembled
from ..estimator import Measured
from ..fem import assemble, boundary_trace, model_of
from ..mesh import keep_parents, vertex_parents
from ..output import check_path, replacing
from ..problem import Problem, table
from ..solved import Solved

SUFFIX = ".ngcontact"
FORMAT = 1  # of the files
MADE = ("_estimate", "_bound")  # members that cost much, kept where they have been made


Number = int | float


def record_of(solution: Measured) -> dict[str, Number]:
    """A flat dict of numbers; see `Solution.record`."""
    solution.discrete.space.require_mesh()
    estimated = solution.estimated or solution.adaptive
    row: dict[str, Number] = {
        "order": int(solution.order),
        "elements": int(solution.mesh.ne),
        "unknowns": int(solution.displacement.space.ndof),
        "points": len(solution.points),
        "active": int(np.count_nonzero(solution.active)),
        "steps": len(solution.steps),
        "energy": float(solution.energy),
        "energy_norm": float(solution.energy_norm),
        "error_estimate": float(solution.error_estimate) if estimated else math.nan,
        "relative_error_estimate": (
            float(solution.relative_error_estimate) if estimated else math.nan
        ),
        "error_bound": float(solution.error_bound) if solution.bounded else math.nan,
        "relative_error_bound": (
            float(solution.relative_error_bound) if solution.bounded else math.nan
        ),
    }
    for number, pair in enumerate(solution.pairs):
        x, y = (solution.contact_force(number) + 0.0).tolist()  # no -0.0
        row |= {
            f"contact_{number}_force_x": x,
            f"contact_{number}_force_y": y,
            f"contact_{number}_peak_pressure": float(pair.pressure.max(initial=0.0)),
            f"contact_{number}_active": int(np.count_nonzero(pair.active)),
            f"contact_{number}_points": int(pair.gap.size),
        }
    for name, reaction in solution.reactions.items():
        x, y = (reaction + 0.0).tolist()
        row |= {f"reaction_{name}_x": x, f"reaction_{name}_y": y}
    row |= {f"residual_{name}": float(value) for name, value in solution.residuals.items()}
    return row | {f"work_{name}": int(count) for name, count in solution.work.items()}


def line_of(solution: Measured) -> str:
    """Unknowns, active points, steps, forces of all pairs; estimate and bound where known."""
    return ", ".join(f"{name} {value}" if name else value for name, value in facts(solution))


def forces(solution: Measured) -> str:
    """Sizes of the forces of all pairs, with the names of the secondaries if there are several."""
    contact = solution.problem.contact
    sizes = [_six_digits(np.hypot(*solution.contact_force(k))) for k in range(len(contact))]
    if len(contact) < 2:
        return "".join(sizes)
    return ", ".join(f"{pair.secondary} {size}" for pair, size in zip(contact, sizes, strict=True))


def _six_digits(size: float) -> str:
    """Always so many, that columns of neighbouring lines agree."""
    return f"{size:#.6g}".rstrip(".")


def facts(solution: Measured) -> list[tuple[str, str]]:
    """What is worth a word, by name; of one width in all lines of a run but for the last ones."""
    active = f"{np.count_nonzero(solution.active)}/{solution.active.size}"
    told = [
        ("order", f"{solution.order}"),
        ("", f"{solution.displacement.space.ndof:7d} unknowns"),
        ("", f"{active:>9} active"),
        ("", f"{len(solution.steps):2d} steps"),
    ]
    if solution.estimated or solution.adaptive:
        told.append(("estimate", f"{solution.relative_error_estimate:.2e}"))
    if solution.bounded:
        told.append(("bound", f"{solution.relative_error_bound:.2e}"))
    if solution.problem.contact:
        told.append(("force", forces(solution)))
    if solution.free_motions:
        told.append(("free:", "; ".join(map(str, solution.free_motions))))
    return told


def html_of(solution: Measured) -> str:
    """What a notebook shows: facts, then a line for each pair."""
    rows = [(name, value.strip()) for name, value in _named(solution)]
    about = table(("", ""), rows)
    if not solution.problem.contact:
        return about
    lines = []
    for number, (pair, contact) in enumerate(
        zip(solution.pairs, solution.problem.contact, strict=True)
    ):
        x, y = solution.contact_force(number) + 0.0
        peak = float(pair.pressure.max(initial=0.0))
        active = f"{np.count_nonzero(pair.active)}/{pair.gap.size}"
        force = f"({x:.6g}, {y:.6g})"
        lines.append((str(number), contact.named(), force, f"{peak:.6g}", active))
    return about + table(("contact", "of", "force", "peak pressure", "active"), lines)


def _named(solution: Measured) -> list[tuple[str, str]]:
    """Facts with a name each, without those of pairs."""
    words = (
        (name, value) if name else tuple(reversed(value.strip().split(" ", 1)))
        for name, value in facts(solution)
        if name != "force"
    )
    return [(name.rstrip(":"), value) for name, value in words]


def state_of(solution: Solved) -> dict[str, Any]:
    """What a solution is made of again by `restored`, all of it fit to be pickled."""
    discrete, plain = solution.discrete, {"discrete", "displacement"}
    discrete.space.require_mesh()
    own = {name: getattr(solution, name) for name in _names(solution) if name not in plain}
    own |= {name: vars(solution)[name] for name in MADE if name in vars(solution)}
    arrays = {name: getattr(discrete, name) for name in _names(discrete)}
    for name in ("problem", "space", "program", "systems"):
        del arrays[name]
    if discrete.rigid is not None:
        arrays["rigid"] = discrete.rigid.on(None)
    program = {name: getattr(discrete.program, name) for name in _names(discrete.program)}
    del program["K"]
    return {
        "own": own,
        "arrays": arrays,
        "program": program,
        "nodal": discrete.space.nodal,
        "load": discrete.space.f,
        "parents": vertex_parents(solution.mesh),
        "displacement": solution.displacement.vec.FV().NumPy().copy(),
    }


def restored(state: dict[str, Any]) -> dict[str, Any]:
    """Members of a solution, from its `state_of`."""
    own = state["own"]
    problem, mesh, order = own["problem"], own["mesh"], own["order"]
    keep_parents(mesh, state["parents"])
    trace = boundary_trace(mesh, order, model_of(problem))
    space = replace(assemble(problem, trace, own["element"], state["nodal"]), f=state["load"])
    discrete = reassembled(problem, space, state["program"], state["arrays"])
    displacement = ng.GridFunction(space.V)
    displacement.vec.FV().NumPy()[:] = state["displacement"]
    return own | {"discrete": discrete, "displacement": displacement}


def _names(data: Any) -> list[str]:
    """Names of the fields of a dataclass."""
    return [field.name for field in fields(data)]


def save(solution: Solved, path: str | os.PathLike[str], version: str) -> Path:
    """Write a solution to `path`; see `Solution.save`."""
    target = check_path(path, SUFFIX)
    solution.discrete.space.require_mesh()
    try:
        data = pickle.dumps(solution)
    except Exception as error:
        for what, value in _parts(solution.problem):
            try:
                pickle.dumps(value)
            except Exception as cause:
                raise TypeError(
                    f"{what} cannot be saved ({cause}): give numbers, CoefficientFunctions of "
                    "coordinates, or a function defined at the top of a module"
                ) from cause
        raise TypeError(f"the solution cannot be saved: {error}") from error
    header = {"ngcontact": version, "format": FORMAT}
    with replacing(target) as (draft,), gzip.open(draft, "wb", compresslevel=4) as file:
        file.write(pickle.dumps(header))
        file.write(data)
    return target


def _parts(problem: Problem) -> Iterator[tuple[str, Any]]:
    """The data one by one, with their names."""
    yield "geometry", problem.geometry
    for argument in ("materials", "displacement", "traction", "force"):
        for name, value in getattr(problem, argument).items():
            yield f'{argument} "{name}"', value
    for number, pair in enumerate(problem.contact):
        yield f'contact[{number}].gap of "{pair.secondary}"', pair.gap


def read(path: str | os.PathLike[str], version: str) -> Any:
    """What `save` wrote to `path`."""
    source = Path(path)
    try:
        with gzip.open(source, "rb") as file:
            header = pickle.load(file)
            if not isinstance(header, dict) or header.get("format") != FORMAT:
                raise ValueError(f"{str(source)!r} is of another format: {header!r:.80}")
            try:
                return pickle.load(file)
            except (AttributeError, ImportError, TypeError, KeyError) as error:
                raise ValueError(
                    f"{str(source)!r} was written by ngcontact {header.get('ngcontact')} and "
                    f"cannot be read by {version}, or needs a module that is missing here: {error}"
                ) from error
    except (gzip.BadGzipFile, EOFError, pickle.UnpicklingError) as error:
        raise ValueError(
            f"{str(source)!r} is no complete result of ngcontact ({error}): give a file written "
            "by Solution.save"
        ) from error
