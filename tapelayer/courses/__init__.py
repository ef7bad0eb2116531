"""Tape courses and the files that hold them."""
