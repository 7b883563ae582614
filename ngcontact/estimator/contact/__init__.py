"""Residuals on Gamma_K, and which parts of the boundary face no body."""

from .facing import between_nodes as between_nodes
from .facing import remaining as remaining
from .tractions import closing_energy as closing_energy
from .tractions import on_contact as on_contact
