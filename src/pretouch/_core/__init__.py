"""Provide code that all packages of pretouch share: errors, units, argument checks and compiled code."""
