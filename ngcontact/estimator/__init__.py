"""Error indicators of a solution, functions of one signature, `Estimator`; bounds of its error."""

from .bound import refuse_bound as refuse_bound
from .indicators import Estimate as Estimate
from .indicators import Estimator as Estimator
from .quantities import Measured as Measured
from .quantities import Quantities as Quantities
from .quantities import Quantity as Quantity
from .residual import estimate as estimate
