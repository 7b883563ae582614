"""Gallery of problem geometries: named bodies in the plane, ready for contact.

Every function returns a netgen ``OCCGeometry`` of dimension 2. The bodies are a compound of
separate faces, so that the mesh keeps distinct, coincident nodes where they touch. The names of
bodies and boundaries stand in the docstring of each function. Lengths are in any consistent unit.
"""

from ngcontact.geometries.concentric import rings
from ngcontact.geometries.curved import graphs
from ngcontact.geometries.discs import disc, disc_on_block, disc_on_disc
from ngcontact.geometries.straight import blocks, punch

__all__ = ["blocks", "disc", "disc_on_block", "disc_on_disc", "graphs", "punch", "rings"]
