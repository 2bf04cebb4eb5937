"""Compare pretouch with other tools (peers) in one process, pair by pair: `python -m benchmarks.peers --help`."""
