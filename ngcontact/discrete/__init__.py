"""The discrete problems (P_1h), (P_2h) of HH81: assembled, in equilibrium, started, reused."""

from .admissible_set import resultants as resultants
from .discrete_problem import MULTIGRID as MULTIGRID
from .discrete_problem import DiscreteProblem as DiscreteProblem
from .discrete_problem import carried_active_set as carried_active_set
from .discrete_problem import discretise as discretise
from .discrete_problem import first_active_set as first_active_set
from .discrete_problem import minimise_energy as minimise_energy
from .discrete_problem import reassembled as reassembled
from .equilibrium import RigidMotion as RigidMotion
from .equilibrium import load_by_shape as load_by_shape
