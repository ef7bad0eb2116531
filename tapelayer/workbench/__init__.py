"""Workbench: the code generation system as a web page and an HTTP API, both a thin layer on the library."""
