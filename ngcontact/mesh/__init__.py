"""Meshes: exact CAD curves, first meshes with matched nodes, curving, parents of vertices."""
