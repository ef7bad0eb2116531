"""What the reports of both machines share."""
