"""What can be traded for what: fronts of choices that none beats, and what no controller can beat."""
