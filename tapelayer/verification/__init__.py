"""Verification: the checks that the judges of both machines share."""
