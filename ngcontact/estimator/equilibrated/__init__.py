"""Bounds of the error that are proved, by stresses in equilibrium."""

from .bound import error_bound as error_bound
from .parts import ErrorBound as ErrorBound
from .pressures import bernstein as bernstein
from .readings import Guaranteed as Guaranteed
from .refusals import refuse_bound as refuse_bound
from .stress import EquilibratedStress as EquilibratedStress
