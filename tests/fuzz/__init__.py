"""Long random searches for faults, run by hand: `python -m fuzz.encounters`, with the tests on the path."""
