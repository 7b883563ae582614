"""Convex quadratic programs with one-sided rows, and their active-set solver. Arrays only."""

from .active_set import minimise as minimise
from .null_space import FREE as FREE
from .null_space import NullSpace as NullSpace
from .null_space import no_null_space as no_null_space
from .null_space import pinned_null_space as pinned_null_space
from .null_space import vanishing_combinations as vanishing_combinations
from .optimality import kkt_residuals as kkt_residuals
from .optimality import terms as terms
from .quadratic_program import Iterate as Iterate
from .quadratic_program import QuadraticProgram as QuadraticProgram
from .schur_complement import BorderedSystems as BorderedSystems
from .schur_complement import bordered_systems as bordered_systems
from .solving import solve_qp as solve_qp
from .systems import REFINED as REFINED
from .systems import ROUGH as ROUGH
from .systems import Anchor as Anchor
from .systems import Approximation as Approximation
from .systems import LinearSystems as LinearSystems
from .systems import SingularError as SingularError
from .systems import first_approximation as first_approximation
