"""Reference facets: nodes, basis functions and quadrature. NumPy only."""
