"""Course files and a model to try the commands on: natural paths, and a panel, on analytic surfaces."""
