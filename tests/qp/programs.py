"""Quadratic programs, factorisations and what is right of minimisers, for several tests."""

import numpy as np
import scipy.sparse as sp

from ngcontact.qp.quadratic_program import QuadraticProgram, no_null_space


def membrane(n=60, load=-1.0, height=-0.02):
    """An obstacle problem with one unknown per row: K, b, bounds of -u <= height."""
    h = 1 / (n + 1)
    K = sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(n, n), format="csr") / h
    return K, np.full(n, load * h), np.full(n, -height)


def first_unknowns_bounded(K, b, g, null_space=None):
    """The program of bounds g on the first unknowns, none of them fixed."""
    m, n = g.size, b.size
    return QuadraticProgram(
        K=K,
        b=b,
        g=g,
        equality=np.zeros(m, dtype=bool),
        fixed=np.zeros(n, dtype=bool),
        values=np.zeros(n),
        unknown=np.arange(m),
        null_space=null_space or no_null_space(n),
    )


def inequalities(A, f, B, g):
    """The program of any rows B u <= g."""
    m, n = np.shape(B)
    return QuadraticProgram(
        K=sp.csr_array(A),
        b=f,
        R=sp.csr_array(B),
        g=g,
        equality=np.zeros(m, dtype=bool),
        fixed=np.zeros(n, dtype=bool),
        values=np.zeros(n),
    )


def counting_factor(K, calls):
    """Dense factor of principal submatrices that records each request."""

    def factor(free):
        calls.append(free.copy())
        inverse = np.zeros(K.shape)
        inverse[np.ix_(free, free)] = np.linalg.inv(K.toarray()[np.ix_(free, free)])
        return lambda right: inverse @ right

    return factor


ROUND_OFF = 1e-14  # of a solve, times the condition number: 45 units, entries are summed by tens

# The plain method cycles on the first two for ever, on the third in round-off of a tie.
CYCLES = {
    "T-cyc-1": ([[5, -2, -3], [-2, 5, 2], [-3, 2, 2]], [-5, 1, 3], [0, 0, 1.5]),
    "T-cyc-1 moved": ([[5, -2, -3], [-2, 5, 2], [-3, 2, 2]], [-5.01, 1.02, 3], [0, 0, 1.5]),
    "T-cyc-2": ([[18, 6, -12], [6, 10, -8], [-12, -8, 19]], [0, 4, 1], [0, 2 / 3, 1 / 3]),
}


def dual(S, d):
    """The program A, f, B, g whose multipliers minimise 1/2 x'Sx - d'x over x >= 0."""
    A = np.linalg.inv(S)
    A = (A + A.T) / 2
    return A, A @ d, np.eye(len(d)), np.zeros(len(d))


def independent(draw, m, n, integers=False):
    """Rows (m, n) none of which is nearly a combination of the others."""
    while True:
        B = draw.integers(-2, 3, (m, n)).astype(float) if integers else draw.normal(size=(m, n))
        if np.linalg.svd(B, compute_uv=False)[-1] > 0.05:
            return B


def random_program(draw, m):
    """Normal entries; as many unknowns as rows or a few more."""
    n = m + int(draw.integers(1, 5))
    X = draw.normal(size=(n, n + 1))
    A = X @ X.T + np.eye(n) / n
    return A, draw.normal(size=n), independent(draw, m, n), draw.normal(size=m)


def tied_program(draw, m):
    """Small integers with exact ties, force and slack both 0, and the minimiser and forces.

    A is a matrix of half the rank plus a multiple of the identity.
    """
    n = m + int(draw.integers(1, 5))
    X = draw.integers(-3, 4, (n, max(1, n // 2))).astype(float)
    A = X @ X.T + int(draw.integers(1, 5)) * np.eye(n)
    B = independent(draw, m, n, integers=True)
    u = draw.integers(-2, 3, n).astype(float)
    kind = draw.integers(0, 3, m)
    force = np.where(kind == 0, draw.integers(1, 5, m), 0).astype(float)
    slack = np.where(kind == 2, draw.integers(1, 4, m), 0).astype(float)
    return (A, A @ u + B.T @ force, B, B @ u + slack), u, force


def kkt_residual(program, result):
    """Largest violation of the optimality conditions relative to the size of the terms."""
    A, f, B, g = program
    u, force = result.u, result.force
    slack = g - B @ u
    tiny = np.finfo(float).tiny
    load = max(np.abs(x).max() for x in (f, A @ u, B.T @ force)) + tiny
    terms, free = np.abs(B), np.abs(np.linalg.solve(A, f))
    # A minimiser at 0 is known to round-off of the one without the rows, no force to that of f.
    length = max(np.abs(x).max() for x in (g, terms @ np.abs(u), terms @ free)) + tiny
    largest = max(np.abs(force).max(), load / np.abs(B).max())
    return float(
        max(
            np.abs(A @ u + B.T @ force - f).max() / load,
            -slack.min() / length,
            -force.min() / largest,
            np.abs(force / largest * (slack / length)).max(),
        )
    )


def condition(program):
    """Condition number of A or of B A^-1 B', whichever is larger."""
    A, _, B, _ = program
    rows = np.linalg.svd(np.linalg.solve(np.linalg.cholesky(A), B.T), compute_uv=False)
    return float(max(np.linalg.cond(A), (rows[0] / rows[-1]) ** 2))
