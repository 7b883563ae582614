"""Convex quadratic programs with one-sided rows, and their active-set solver. Arrays only."""
