"""Meshes: exact CAD curves, first meshes with matched nodes, curving, parents of vertices."""

from .cad import CadEdge as CadEdge
from .cad import cad_edges as cad_edges
from .cad import same_geometry as same_geometry
from .curving import check_curves as check_curves
from .curving import copied as copied
from .curving import curve as curve
from .curving import keep_parents as keep_parents
from .curving import resolved_lengths as resolved_lengths
from .curving import unresolved as unresolved
from .curving import vertex_parents as vertex_parents
from .faces import CadFace as CadFace
from .faces import cad_faces as cad_faces
from .faces import curved_facets as curved_facets
from .faces import feet_on_faces as feet_on_faces
from .files import read as read
from .generation import first_mesh as first_mesh
from .generation import graded_mesh as graded_mesh
from .generation import opposite as opposite
