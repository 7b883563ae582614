"""Error indicators of a solution, and bounds of its error."""

from .bound import Guaranteed as Guaranteed
from .bound import refuse_bound as refuse_bound
from .quantities import Measured as Measured
from .quantities import Quantities as Quantities
from .quantities import Quantity as Quantity
from .quantities import earlier_figures as earlier_figures
from .quantities import pressure_field as pressure_field
from .residual import Estimate as Estimate
from .residual import Estimated as Estimated
from .residual import estimate as estimate
