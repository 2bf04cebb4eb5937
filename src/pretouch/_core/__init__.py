"""Provide what all other packages share: errors, units, argument checks, report pages and the compiled core."""
