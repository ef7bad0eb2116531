"""Course files to try the commands on: natural paths on analytic surfaces."""
