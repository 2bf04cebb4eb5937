"""
A figure of the letter
======================

Figure 4 of the letter, recomputed. `pretouch reproduce` writes the report of all tables and figures.
"""

import pretouch as pt

figure = pt.letter.reproduce(["figure-4"]).plot()
