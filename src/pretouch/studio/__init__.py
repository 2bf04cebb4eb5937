"""Serve the studio, a page in the browser on which users choose a gain by dragging it with the mouse.

The browser itself computes motions, optimal gains and limits, with the compiled core as WebAssembly. The server fits
calibrations, simulates, verifies and exports.
"""
