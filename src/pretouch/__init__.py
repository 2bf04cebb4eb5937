"""Choose the gain of a preemptive impact controller without one collision."""
