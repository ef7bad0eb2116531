"""What the judges of both machines share."""
