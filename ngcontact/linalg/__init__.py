"""Sparse matrices and solvers that NGSolve and SciPy share."""
