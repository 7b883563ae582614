"""Convex quadratic programs with one-sided rows, and their active-set solver. Arrays only."""

from .active_set import minimise as minimise
from .active_set import solve_qp as solve_qp
from .quadratic_program import NULL_SPACE_TOLERANCE as NULL_SPACE_TOLERANCE
from .quadratic_program import Anchor as Anchor
from .quadratic_program import Iterate as Iterate
from .quadratic_program import NullSpace as NullSpace
from .quadratic_program import QuadraticProgram as QuadraticProgram
from .quadratic_program import SingularError as SingularError
from .quadratic_program import kkt_residuals as kkt_residuals
from .quadratic_program import no_null_space as no_null_space
from .quadratic_program import pinned_null_space as pinned_null_space
from .quadratic_program import terms as terms
from .quadratic_program import vanishing_combinations as vanishing_combinations
from .schur_complement import COARSE_RESIDUAL as COARSE_RESIDUAL
from .schur_complement import FINE_RESIDUAL as FINE_RESIDUAL
from .schur_complement import BorderedSystems as BorderedSystems
