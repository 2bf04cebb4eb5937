"""Rewrite the output of pretouch that snapshots, README and documentation quote."""
