"""Jobs: from a source to a program that was read back and judged, on any kind of machine."""
