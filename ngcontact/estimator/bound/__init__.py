"""A bound of the error that is proved, by one dual contact problem."""

from .bound import Proof as Proof
from .bound import error_bound as error_bound
from .bound import refuse_bound as refuse_bound
from .force import force_bar as force_bar
from .readings import WORK_BONUS as WORK_BONUS
from .readings import ContactPressure as ContactPressure
from .readings import EquilibratedStress as EquilibratedStress
from .readings import Guaranteed as Guaranteed
