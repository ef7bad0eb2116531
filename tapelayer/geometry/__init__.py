"""Curves, paths and meshes: shapes in space, independent of machines and time."""
