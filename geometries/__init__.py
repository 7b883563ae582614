"""Gallery of problem geometries: named bodies in the plane and in space, ready for contact.

Every function returns a netgen ``OCCGeometry``. The bodies are a compound of separate faces, or of
separate solids, so that the mesh keeps distinct, coincident nodes where they touch. The names of
bodies and boundaries stand in the docstring of each function. Lengths are in any consistent unit.
"""

from ngcontact.geometries.concentric import ball_in_socket, rings
from ngcontact.geometries.curved import graphs
from ngcontact.geometries.discs import disc, disc_on_block, disc_on_disc
from ngcontact.geometries.revolved import cone_on_block, ring_in_groove, rounded_punch
from ngcontact.geometries.solids import (
    ball_in_cup,
    ball_on_block,
    crossed_cylinders,
    cube_on_block,
    shells,
)
from ngcontact.geometries.straight import blocks, punch, sleeve_on_shaft

__all__ = [
    "ball_in_cup",
    "ball_in_socket",
    "ball_on_block",
    "blocks",
    "cone_on_block",
    "crossed_cylinders",
    "cube_on_block",
    "disc",
    "disc_on_block",
    "disc_on_disc",
    "graphs",
    "punch",
    "ring_in_groove",
    "rings",
    "rounded_punch",
    "shells",
    "sleeve_on_shaft",
]
