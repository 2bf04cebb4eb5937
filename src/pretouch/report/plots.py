"""Provide all figures under short names such as `plots.motion(design)`; each is imported on first use.

The stub plots.pyi lists them. A `Picture` of a page refers to its figure by the same name.
"""

from __future__ import annotations

from pretouch._core.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__)
