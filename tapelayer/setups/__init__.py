"""Setups: typed values of a job, from TOML files and from forms."""
