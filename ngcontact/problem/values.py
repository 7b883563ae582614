"""Values of data and names of regions: what is accepted, and what would be right."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from numbers import Real
from typing import Any, NoReturn, TypeAlias
from weakref import WeakKeyDictionary

import ngsolve as ng
import numpy as np

SYMMETRIC = 1e-12  # difference of entries, relative to the largest: input has that many digits
TUPLES = {2: "a pair", 3: "a triple"}  # of components, by the dimension

STRAINS = {
    2: "give a number, which acts in all three directions, a pair (xx, yy), a triple (xx, yy, zz), "
    "about an axis (rr, zz, hoop), or a symmetric matrix (2, 2)",
    3: "give a number, which acts in all three directions, a triple (xx, yy, zz), or a symmetric "
    "matrix (3, 3)",
}
STRAIN_SHAPES = {2: [(), (1,), (2,), (3,), (2, 2)], 3: [(), (1,), (3,), (3, 3)]}
# Components of an initial strain, xx, yy, the one normal to the plane, the engineering shear
# gamma_xy, and of solids gamma_yz, gamma_xz, by the places of their parts in the data of a size.
STRAIN_PLACES = {
    1: [[0], [0], [0], [], [], []],
    2: [[0], [1], [], [], [], []],
    3: [[0], [1], [2], [], [], []],
    4: [[0], [3], [], [1, 2], [], []],
    9: [[0], [4], [8], [1, 3], [5, 7], [2, 6]],
}

Scalar: TypeAlias = float | ng.CoefficientFunction
Vector: TypeAlias = Sequence[Scalar] | ng.CoefficientFunction


def boundary_mask(mesh: ng.Mesh, pattern: str) -> np.ndarray:
    """Return which of r boundary region numbers a name or pattern selects, bool (r,)."""
    return _mask(mesh.Boundaries, pattern)


def body_mask(mesh: ng.Mesh, pattern: str) -> np.ndarray:
    """Return which of r material region numbers a name or pattern selects, bool (r,)."""
    return _mask(mesh.Materials, pattern)


def _mask(select: Callable[[str], ng.Region], pattern: str) -> np.ndarray:
    try:
        return region_mask(select(pattern))
    except RuntimeError as error:
        raise ValueError(f'"{pattern}" is no name and no regular expression: {error}') from error


def region_mask(region: ng.Region) -> np.ndarray:
    """Return which of r region numbers are in a region, bool (r,)."""
    mask = region.Mask()  # iterated over, it would end by an exception of C++: ten times the price
    return np.array([*map(mask.__getitem__, range(len(mask)))], dtype=bool)


def scalar_data(value: Any, what: str) -> float | ng.CoefficientFunction:
    """Return a finite float or a real scalar CoefficientFunction; `what` leads the message."""
    if isinstance(value, ng.CoefficientFunction):
        if value.dim != 1:
            raise ValueError(f"{what} is a CoefficientFunction of dim {value.dim}: give a scalar")
        if value.is_complex:
            raise TypeError(f"{what} is a complex CoefficientFunction: it must be real")
        return value
    if isinstance(value, bool) or not isinstance(value, Real):
        raise TypeError(f"{what} = {value!r}: give a real number or a scalar CoefficientFunction")
    if not math.isfinite(value):
        raise ValueError(f"{what} = {value}: give a finite number")
    return float(value)


def refuse_where(
    points: np.ndarray, bad: np.ndarray, values: np.ndarray, what: str, right: str
) -> None:
    """Refuse the first of mesh `points` (n,) that is `bad` (n,), with its of `values` (n, ...)."""
    if bad.any():
        first = int(np.argmax(bad))
        x = ng.CF((ng.x, ng.y, ng.z))(points)
        place = ", ".join(f"{c:.6g}" for c in x[first, : 3 if x[:, 2].any() else 2])
        raise ValueError(f"{what} = {values[first].tolist()} at ({place}): {right}")


def region_name(value: Any, what: str) -> str:
    """Return a region name or pattern; `what` leads the message of a refusal."""
    if not isinstance(value, str):
        raise TypeError(f"{what} = {value!r}: give a region name or pattern, a string")
    if not value:
        raise ValueError(f'{what} = "": give a region name or pattern')
    return value


class Regions(dict[str, Any]):
    """Data of a problem by region name; a dict that refuses to be changed, and says what to do."""

    def __init__(self, what: str, data: Mapping[str, Any]) -> None:
        super().__init__(data)
        self.what = what

    def _refuse(self, *_: Any, **__: Any) -> NoReturn:
        raise TypeError(
            f"problem.{self.what}: the data of a Problem cannot be changed; make another by "
            f"dataclasses.replace(problem, {self.what}=problem.{self.what} | {{...}})"
        )

    __setitem__ = __delitem__ = __ior__ = _refuse
    update = pop = popitem = clear = setdefault = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        """Made again from a plain dict where it is copied or pickled."""
        return Regions, (self.what, dict(self))


def by_region(value: Any, what: str, normalise: Callable[[Any, str], Any]) -> Regions:
    """Return normalised values by name; None is empty."""
    if value is None:
        return Regions(what, {})
    if not isinstance(value, Mapping):
        raise TypeError(f"{what} = {value!r}: give a dict from region names to values")
    entries = {
        region_name(name, f"a name in {what}"): normalise(entry, f'{what} "{name}"')
        for name, entry in value.items()
    }
    return Regions(what, entries)


def entries_of(value: Any, what: str, dim: int) -> tuple[Any, ...]:
    """Return the entries of a sequence, or of a CoefficientFunction, of `dim` of them."""
    tuple_ = TUPLES[dim]
    if isinstance(value, ng.CoefficientFunction):
        if tuple(value.dims) != (dim,):
            dims = tuple(value.dims)
            raise ValueError(f"{what} is a CoefficientFunction of dims {dims}: give a {dim}-vector")
        return tuple(value[i] for i in range(dim))
    if not isinstance(value, Sequence | np.ndarray) or isinstance(value, str):
        raise TypeError(f"{what} = {value!r}: give {tuple_} or a CoefficientFunction of dim {dim}")
    if len(value) != dim:
        raise ValueError(f"{what} = {value!r} has length {len(value)}: give {tuple_}")
    return tuple(value)


def displacement_components(
    value: Any, what: str, dim: int
) -> tuple[ng.CoefficientFunction | None, ...]:
    """Return the components of a prescribed displacement, `dim` of them, None where one is free."""
    components = tuple(
        None if entry is None else ng.CF(scalar_data(entry, what))
        for entry in entries_of(value, what, dim)
    )
    if components == (None,) * dim:
        raise ValueError(f"{what} = {components} prescribes nothing: leave the boundary out")
    return components


def vector_data(value: Any, what: str, dim: int) -> ng.CoefficientFunction:
    """Return a vector field of `dim` components."""
    entries = tuple(scalar_data(entry, what) for entry in entries_of(value, what, dim))
    return value if isinstance(value, ng.CoefficientFunction) else ng.CF(entries)


def traction_data(value: Any, what: str, dim: int) -> ng.CoefficientFunction:
    """Return a pressure (dim 1) or a traction of `dim` components."""
    vector = isinstance(value, Sequence | np.ndarray) and not isinstance(value, str)
    if vector or (isinstance(value, ng.CoefficientFunction) and value.dim != 1):
        return vector_data(value, what, dim)
    return ng.CF(scalar_data(value, what))


def strain_data(value: Any, what: str, dim: int) -> ng.CoefficientFunction:
    """A strain as it was given, a scalar, (2,), (3,) or a matrix, for `strain_components`."""
    right = STRAINS[dim]
    if isinstance(value, ng.CoefficientFunction):
        if tuple(value.dims) not in STRAIN_SHAPES[dim]:
            dims = tuple(value.dims)
            raise ValueError(f"{what} is a CoefficientFunction of dims {dims}: {right}")
        if value.is_complex:
            raise TypeError(f"{what} is a complex CoefficientFunction: it must be real")
        return value
    if not isinstance(value, Sequence | np.ndarray) or isinstance(value, str):
        return ng.CF(scalar_data(value, what))
    rows = [list(row) if isinstance(row, Sequence | np.ndarray) else [row] for row in value]
    columns = {len(row) for row in rows}
    scalars = not any(isinstance(row, Sequence | np.ndarray) for row in value)
    shape = (len(rows),) if scalars else (len(rows), *columns)
    if shape not in STRAIN_SHAPES[dim] or shape == (1,):
        raise ValueError(f"{what} = {value!r}: {right}")
    entries = tuple(scalar_data(entry, what) for row in rows for entry in row)
    return ng.CF(entries, dims=shape) if len(shape) == 2 else ng.CF(entries)


def strain_components(data: ng.CoefficientFunction) -> ng.CoefficientFunction:
    """Components (6,) of `strain_data`, by a product: functions are looked for once at a point."""
    size = data.dim
    parts = (float(k in places) for places in STRAIN_PLACES[size] for k in range(size))
    return ng.CF(tuple(parts), dims=(6, size)) * data.Reshape((size,))


def region_pattern(value: Any) -> str | None:
    """Return one pattern for a name, several or none."""
    if value is None or isinstance(value, str):
        return value if value is None else region_name(value, "sliding")
    if not isinstance(value, Sequence):
        raise TypeError(f"sliding = {value!r}: give a region name or a sequence of names")
    return "|".join(region_name(entry, "an entry of sliding") for entry in value) or None


def unit_vector(value: Any, what: str) -> tuple[float, ...]:
    """Return a direction as a unit vector; the size of its entries never overflows."""
    right = "give a pair of numbers, like (0, -1), three for solids, one direction for all"
    if isinstance(value, str | ng.CoefficientFunction):
        raise TypeError(f"{what} = {value!r:.60}: {right}")
    if isinstance(value, Sequence | np.ndarray) and len(value) not in TUPLES:
        raise ValueError(f"{what} = {value!r:.60} has length {len(value)}: {right}")
    dim = 3 if isinstance(value, Sequence | np.ndarray) and len(value) == 3 else 2
    entries = [scalar_data(entry, what) for entry in entries_of(value, what, dim)]
    vector = tuple(entry for entry in entries if isinstance(entry, float))
    if len(vector) < dim:
        raise TypeError(f"{what} = {value!r:.60}: {right}")
    size = max(map(abs, vector))
    if size == 0:
        raise ValueError(f"{what} = {vector}: give a vector from secondary to primary body")
    length = math.hypot(*(x / size for x in vector))
    return tuple(x / size / length for x in vector)


LONG_TEXT = 4000  # characters of what is printed; numbers are short
KNOWN: WeakKeyDictionary[ng.CoefficientFunction, bool] = WeakKeyDictionary()  # numbers or not
# Lines of what NGSolve prints of numbers, in vectors, times others and times the normal.
_NUMBER = r"(?:[-+.\de]+|-?inf|nan)"
_VECTOR = r"unary operation ' '|VectorialCoefficientFunction|reshape"
_DIM = r"(, dim=\d+|, dims = \d+ x \d+)?"
_TIMES = rf"(scale )?{_NUMBER}|scalar-vector multiply|normal vector"
_OF_NUMBERS = re.compile(rf"\s*({_NUMBER}\*\()?(coef ({_VECTOR}|{_TIMES}), real{_DIM})?\s*\)?\s*")


def numbers(data: ng.CoefficientFunction) -> bool:
    """Whether data are made of numbers alone, perhaps times the normal. Looked at once."""
    if data not in KNOWN:  # printing a long expression costs as much as evaluating it
        text = str(data).replace("ZeroCF", "0")
        short = len(text) < LONG_TEXT and all(map(_OF_NUMBERS.fullmatch, text.splitlines()))
        KNOWN[data] = short or text.strip() == "ZeroCoefficientFunction"
    return KNOWN[data]
