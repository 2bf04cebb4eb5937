"""All figures by short names, such as `plots.motion(design)`; each is loaded when it is first drawn.

The stub beside this file lists them. A picture of a page names its figure by the same name.
"""

from __future__ import annotations

from pretouch._core.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__)
