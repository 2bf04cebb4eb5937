"""Whether a designed gain holds on the loop as it will really run: predicted beside simulated, and what to change."""
