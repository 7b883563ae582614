"""Residuals on Gamma_K, and which parts of the boundary face no body."""

from .facing import remaining as remaining
from .tractions import on_contact as on_contact
