"""Pictures of solutions."""

from .picture import plot_solution as plot_solution
from .style import Profile as Profile
from .style import Style as Style
from .style import Unit as Unit
