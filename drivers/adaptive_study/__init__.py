"""Uniform against adaptive refinement."""
