"""Quadratic programs and factorisations that several tests use."""

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
        R=sp.eye_array(n, format="csr")[:m],
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
