"""Compute Pareto fronts, for example of excursion and contact speed, and the physical limit of any controller."""
