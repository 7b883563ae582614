"""Supports and contact rows as arrays, and the basis in which each is one unknown. Arrays only."""

from .basis_transformation import BasisTransformation as BasisTransformation
from .basis_transformation import change_of_basis as change_of_basis
from .rows import Conditions as Conditions
from .rows import Rows as Rows
from .rows import concatenated as concatenated
from .rows import no_conditions as no_conditions
from .rows import no_rows as no_rows
