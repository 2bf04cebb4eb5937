"""Benchmarks of speed and accuracy; each program prints its measurements."""
