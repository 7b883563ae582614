"""Quantities of interest of a contact, each with a bar of its error."""

from .readings import Measured as Measured
from .readings import earlier_figures as earlier_figures
from .surfaces import pressure_field as pressure_field
from .table import Quantities as Quantities
from .table import Quantity as Quantity
