"""Pareto fronts of contact quantities, and the physical bound that holds for every controller."""
