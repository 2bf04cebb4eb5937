"""Write HTML reports and draw figures of results.

The stub __init__.pyi lists the public names. They are imported when they are first used, and Matplotlib when the first
figure is drawn: the text of a result needs neither.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
