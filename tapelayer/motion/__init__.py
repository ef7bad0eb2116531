"""Motion: blocks, switching words, and the time that they take."""
