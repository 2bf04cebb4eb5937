"""Long random searches for faults, run by hand: `python -m fuzz.encounters`, with tests and tools on the path."""
