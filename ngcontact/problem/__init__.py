"""The continuous contact problem of HH81 section 3: laws, pairs, supports, loads, checks."""

from .checks import check_mesh as check_mesh
from .checks import regions_of as regions_of
from .contact import Contact as Contact
from .contact import Gap as Gap
from .material import ABOUT_AN_AXIS as ABOUT_AN_AXIS
from .material import Elastic as Elastic
from .material import Hooke as Hooke
from .material import varies as varies
from .mesh_arrays import AXIS_RADIUS as AXIS_RADIUS
from .mesh_arrays import KEPT as KEPT
from .mesh_arrays import POSITION as POSITION
from .mesh_arrays import MeshArrays as MeshArrays
from .mesh_arrays import bisect as bisect
from .mesh_arrays import move_vertices as move_vertices
from .mesh_arrays import on_axis as on_axis
from .problem import Problem as Problem
from .values import body_mask as body_mask
from .values import boundary_mask as boundary_mask
from .values import numbers as numbers
from .values import region_mask as region_mask
from .values import scalar_data as scalar_data
from .values import strain_components as strain_components
