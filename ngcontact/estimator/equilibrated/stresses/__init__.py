"""Stresses in equilibrium, vertex patch by vertex patch."""

from .conditions import EdgeConditions as EdgeConditions
from .conditions import edge_conditions as edge_conditions
from .conditions import edge_parameters as edge_parameters
from .conditions import with_hats as with_hats
from .corners import divided_elements as divided_elements
from .elements import raw_operators as raw_operators
from .equilibration import Discrete as Discrete
from .equilibration import Equilibrated as Equilibrated
from .equilibration import Units as Units
from .equilibration import degree_for as degree_for
from .equilibration import discrete_on as discrete_on
from .equilibration import equilibrated as equilibrated
from .equilibration import units_of as units_of
from .partition import Partition as Partition
from .partition import partition_of as partition_of
from .polynomials import CORNERS as CORNERS
from .polynomials import basis as basis
from .polynomials import dimension as dimension
from .polynomials import legendre_derivative as legendre_derivative
from .polynomials import legendre_values as legendre_values
