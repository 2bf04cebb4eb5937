"""One file per table, figure and section: its data, its comparisons, and what the program finds."""
