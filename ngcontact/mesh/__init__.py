"""Meshes: exact CAD curves, first meshes with matched nodes, curving, parents of vertices."""

from .cad import CadEdge as CadEdge
from .cad import cad_edges as cad_edges
from .cad import same_geometry as same_geometry
from .curving import check_curves as check_curves
from .curving import curve as curve
from .curving import resolved_lengths as resolved_lengths
from .curving import unresolved as unresolved
from .elements import diameters as diameters
from .elements import neighbours as neighbours
from .elements import rightward as rightward
from .generation import first_mesh as first_mesh
from .parents import copied as copied
from .parents import keep_parents as keep_parents
from .parents import vertex_parents as vertex_parents
