"""Machines: their models, and their closed-form inverse kinematics."""
