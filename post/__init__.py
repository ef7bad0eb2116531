"""NC text: Verified trajectories to programs, and programs back to trajectories."""
