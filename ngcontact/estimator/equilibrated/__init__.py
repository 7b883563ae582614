"""Bounds of the error that are proved, by stresses in equilibrium."""

from .bound import error_bound as error_bound
from .forces import Tested as Tested
from .forces import force_bar as force_bar
from .parts import ErrorBound as ErrorBound
from .pressures import bernstein as bernstein
from .readings import FINE as FINE
from .readings import Guaranteed as Guaranteed
from .refusals import refuse_bound as refuse_bound
from .stress import EquilibratedStress as EquilibratedStress
