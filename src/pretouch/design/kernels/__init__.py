"""Compiled searches for optimal gains: floats and arrays only."""
