"""Pictures of solutions."""

from .picture import plot_solution as plot_solution
from .scene import Profile as Profile
from .scene import Style as Style
from .scene import Unit as Unit
