"""Triangles that are looked at in points: curved, of laws that vary, of a meridian section."""

from .meridian import meridian_rules as meridian_rules
from .meridian import meridian_triangles as meridian_triangles
from .rough import MANDEL as MANDEL
from .rough import Rough as Rough
from .rough import rough_triangles as rough_triangles
from .rough import sampling_order as sampling_order
