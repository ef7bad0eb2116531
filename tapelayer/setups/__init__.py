"""Setups: the typed values of a job, from TOML files and from forms."""
