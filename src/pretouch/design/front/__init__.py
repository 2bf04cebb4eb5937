"""Compute Pareto fronts of contact quantities, and the physical limit that no controller can exceed."""
