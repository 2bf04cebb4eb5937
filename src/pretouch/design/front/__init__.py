"""Compute Pareto fronts of contact quantities, and the physical bound that no controller can beat."""
