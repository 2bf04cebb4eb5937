"""Programs that measure; each prints what it measured, beside a peer run in the same call."""
