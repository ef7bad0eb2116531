"""Workbench: the code generation system in a browser, and the same over HTTP; a thin layer on the library."""
