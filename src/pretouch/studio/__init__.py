"""Serve a page in the browser on which gains are chosen by dragging, with the rest of pretouch behind it.

The page itself needs no server: its computations run in the browser, with the compiled core as WebAssembly.
"""
