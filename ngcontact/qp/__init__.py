"""Convex quadratic programs with one-sided rows, and their active-set solver. Arrays only."""

from .active_set import minimise as minimise
from .null_space import FREE as FREE
from .null_space import Kernel as Kernel
from .null_space import kernel as kernel
from .null_space import no_kernel as no_kernel
from .null_space import null_space as null_space
from .optimality import optimality as optimality
from .optimality import terms as terms
from .quadratic_program import Minimiser as Minimiser
from .quadratic_program import Program as Program
from .schur_complement import REFINED as REFINED
from .schur_complement import ROUGH as ROUGH
from .schur_complement import Anchor as Anchor
from .schur_complement import Systems as Systems
from .solving import solve_qp as solve_qp
