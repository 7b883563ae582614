"""The common problems: statements, meshes, arrays for other codes, and how answers are read."""
