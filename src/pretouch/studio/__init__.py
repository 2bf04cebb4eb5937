"""Serve the studio, a browser page for choosing a gain.

Users drag the gain with the mouse. The browser itself computes motions, optimal gains and limits, with the compiled
core as WebAssembly. The server fits calibrations, simulates, verifies and exports.
"""
