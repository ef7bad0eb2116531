"""Courses planned on a mould: plies, their boundaries and regions; knows no machine."""
