"""A solution in a file that survives the process.

Kept are the data, the mesh, the displacement and all arrays of contact; the stiffness is assembled
again, and factorised when it is next needed.
"""

from __future__ import annotations

import gzip
import os
import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import ngsolve as ng

from ..arrays import by_field
from ..discrete import reassembled
from ..fem import assemble, boundary_trace, model_of
from ..mesh import keep_parents, vertex_parents
from ..output import check_path, replacing
from ..solved import Solved

SUFFIX = ".ngcontact"
FORMAT = 1  # of the files
STORED_MEMBERS = ("_estimate", "_bound")  # members that cost much, kept where they have been made


def state_of(solution: Solved) -> dict[str, Any]:
    """Picklable state from which `restored` makes a solution again."""
    discrete, plain = solution.discrete, {"discrete", "displacement"}
    discrete.space.require_mesh()
    own = {name: x for name, x in by_field(solution).items() if name not in plain}
    own |= {name: vars(solution)[name] for name in STORED_MEMBERS if name in vars(solution)}
    arrays = by_field(discrete)
    for name in ("problem", "space", "program", "systems"):
        del arrays[name]
    program = by_field(discrete.program)
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


def save(solution: Solved, path: str | os.PathLike[str], version: str) -> Path:
    """Write a solution to `path`; see `Solution.save`."""
    target = check_path(path, SUFFIX)
    solution.discrete.space.require_mesh()
    try:
        data = pickle.dumps(solution)
    except Exception as error:
        problem = solution.problem
        parts = [("geometry", problem.geometry)]
        for argument in ("materials", "displacement", "traction", "force", "strain"):
            data = getattr(problem, argument).items()
            parts += [(f'{argument} "{name}"', value) for name, value in data]
        for number, pair in enumerate(problem.contact):
            parts.append((f'contact[{number}].gap of "{pair.secondary}"', pair.gap))
        for what, value in parts:
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


def read(path: str | os.PathLike[str], version: str) -> Any:
    """The solution that `save` wrote to `path`."""
    source, header = Path(path), None
    try:
        with gzip.open(source, "rb") as file:
            header = pickle.load(file)
            if not isinstance(header, dict) or header.get("format") != FORMAT:
                raise ValueError(f"{str(source)!r} is of another format: {header!r:.80}")
            return pickle.load(file)
    except (gzip.BadGzipFile, EOFError, pickle.UnpicklingError) as error:
        raise ValueError(
            f"{str(source)!r} is no complete result of ngcontact ({error}): give a file written "
            "by Solution.save"
        ) from error
    except (AttributeError, ImportError, TypeError, KeyError) as error:
        raise ValueError(
            f"{str(source)!r}, of {header}, cannot be read by ngcontact {version}, or needs a "
            f"module that is missing here: {error}"
        ) from error
