"""Error indicators of a solution: functions of one signature, `Estimator`."""

from .indicators import Estimate as Estimate
from .indicators import Estimator as Estimator
from .residual import estimate as estimate
