"""Gamma_K on a mesh: facing points, gaps, weights, rows, ends of contact."""
