"""Provide the code that all packages of pretouch share.

It contains errors, units, argument checks and the compiled code.
"""
