"""Load scenario files and create design tasks from them.

A scenario file is TOML with units. It is checked against a schema. What designs need is imported when it is first used,
because `pretouch fit` needs only the section [sensor].
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
