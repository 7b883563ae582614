"""Meshes: exact CAD curves, first meshes with matched nodes, curving, parents of vertices."""

from .cad import CadEdge as CadEdge
from .cad import cad_edges as cad_edges
from .cad import rightward as rightward
from .cad import same_geometry as same_geometry
from .generation import check_curves as check_curves
from .generation import copied as copied
from .generation import curve as curve
from .generation import first_mesh as first_mesh
from .generation import keep_parents as keep_parents
from .generation import resolved_lengths as resolved_lengths
from .generation import unresolved as unresolved
from .generation import vertex_parents as vertex_parents
