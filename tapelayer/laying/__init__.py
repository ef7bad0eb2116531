"""The tape layer: from courses to verified programs and their reports."""
