"""What was rendered and measured before, found again by the hash of all that determines it."""
