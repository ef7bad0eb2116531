"""Motion: blocks and switching words, and the time they take."""
