"""The foundation of all other packages: errors, units, checks of arguments, pages of results, the compiled core."""
