"""The finite element spaces V_h: elements, boundary nodes, forms, energies."""
