"""Reporting: the parts that the reports of both machines share."""
