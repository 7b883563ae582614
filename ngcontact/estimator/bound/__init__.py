"""A bound of the error that is proved, by one dual contact problem."""

from .bound import Proof as Proof
from .bound import error_bound as error_bound
from .force import force_bar as force_bar
from .readings import FINE as FINE
from .readings import Guaranteed as Guaranteed
from .refusals import refuse_bound as refuse_bound
from .stress import ContactPressure as ContactPressure
from .stress import EquilibratedStress as EquilibratedStress
