"""Marking and refinement."""
