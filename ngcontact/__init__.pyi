from .contact import find_contacts as find_contacts
from .errors import ContactError as ContactError
from .errors import ContactWarning as ContactWarning
from .errors import ConvergenceError as ConvergenceError
from .errors import NoEquilibriumError as NoEquilibriumError
from .output import plot_convergence as plot_convergence
from .output import write_film as write_film
from .output import write_series as write_series
from .polishing import polish as polish
from .problem import Contact as Contact
from .problem import Elastic as Elastic
from .problem import Hooke as Hooke
from .problem import Problem as Problem
from .qp import solve_qp as solve_qp
from .solution import Solution as Solution
from .solution import load as load
from .solving import adapt as adapt
from .solving import solve as solve

__version__: str
