"""Offline programming for a ten-axis tape-laying gantry: courses in, verified NC programs out."""
