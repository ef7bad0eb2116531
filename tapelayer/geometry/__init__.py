"""Curves, paths and meshes: shapes in space, which know no machine and no time."""
