"""Compute Pareto fronts and the physical limit of any controller."""
