"""The triangles, the polynomials on them, the discrete solution and its data there."""

from .conditions import EdgeConditions as EdgeConditions
from .conditions import edge_conditions as edge_conditions
from .conditions import edge_parameters as edge_parameters
from .conditions import with_hats as with_hats
from .corners import divided_elements as divided_elements
from .curves import CurvedEdges as CurvedEdges
from .curves import bent_segments as bent_segments
from .curves import edge_places as edge_places
from .curves import rigid_motions_on as rigid_motions_on
from .curves import tractions_on_curves as tractions_on_curves
from .partition import Partition as Partition
from .partition import partition_of as partition_of
from .polynomials import CORNERS as CORNERS
from .polynomials import basis as basis
from .polynomials import dimension as dimension
from .polynomials import lattice as lattice
from .polynomials import legendre_derivative as legendre_derivative
from .polynomials import legendre_values as legendre_values
from .rough import Rough as Rough
from .solution import Discrete as Discrete
from .solution import Units as Units
from .solution import degree_for as degree_for
from .solution import discrete_on as discrete_on
from .solution import units_of as units_of
