"""pretouch and each peer on the same work, in one process and pair by pair: `python -m benchmarks.peers --help`."""
