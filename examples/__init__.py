"""Examples: course files and a model, all on analytic surfaces, and scripts that show what the library does."""
