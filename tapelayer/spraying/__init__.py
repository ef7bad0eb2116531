"""The spray robot: from a mesh to verified programs and their reports."""
