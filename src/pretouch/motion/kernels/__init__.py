"""Compiled kernels: floats and arrays in, floats and arrays out. Loaded only when a motion is solved."""
