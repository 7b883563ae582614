"""The pressure p* on Gamma_K of an equilibrated stress."""

from .balance import balanced as balanced
from .cuts import facing_cuts as facing_cuts
from .ends import contact_ends as contact_ends
from .ends import split as split
from .pieces import SLIVER as SLIVER
from .pieces import Pieces as Pieces
from .pieces import contact_directions as contact_directions
from .pieces import pieces_of as pieces_of
from .reach import Reach as Reach
from .reach import reaches_of as reaches_of
from .selection import selected as selected
from .zone import Zone as Zone
from .zone import ZonePoints as ZonePoints
from .zone import bernstein as bernstein
from .zone import contact_jacobian as contact_jacobian
from .zone import zone_of as zone_of
from .zone import zone_points as zone_points
