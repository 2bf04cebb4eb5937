"""Show drawn pictures in dark colors in dark mode, and the columns of a wide picture one below the other on a phone.

Both are found from the pixels of a picture, so that they apply to every picture of the site.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

_WHITE = 250  # smallest value of a color of a white pixel
_DRAWN = 0.3  # share of white pixels from which a picture is a drawing, and not a picture of a robot
_LEAST = 0.25  # share of the width of the narrowest column
_GAP = 0.005  # share of the width of the narrowest gap between columns
_IMAGE = re.compile(r'<img [^>]*?src="[^"]*_images/([^"]+\.png)"[^>]*>')


@cache
def is_drawn(path: Path) -> bool:
    """Return True if a picture is drawn on white."""
    return bool(_white(path).mean() > _DRAWN)


@cache
def columns_of(path: Path) -> list[tuple[float, float]]:
    """Return the left and right ends of the columns of a drawing, as shares of its width.

    A white gap from top to bottom separates two columns. A gap next to the edge of a column, as between an axis and its
    label, separates none.
    """
    white = _white(path).all(axis=0)
    size, ends = len(white), [0.0]
    edges = np.flatnonzero(np.diff(np.concatenate([[False], white, [False]]).astype(int)))
    for start, stop in edges.reshape(-1, 2):
        wide = stop - start >= _GAP * size
        if wide and start > (ends[-1] + _LEAST) * size and stop < (1 - _LEAST) * size:
            ends.append(float(start + stop) / 2 / size)
    return list(zip(ends, [*ends[1:], 1.0], strict=True))


def adapted(image: str, path: Path) -> str:
    """Return the HTML of a picture that adapts to dark mode and narrow screens."""
    if not is_drawn(path):
        return image
    drawn = image.replace("<img ", '<img data-drawn="" ', 1)
    columns = columns_of(path)
    if len(columns) == 1 or "thumb" in path.name:
        return drawn
    unnamed = re.sub(r'alt="[^"]*"', 'alt=""', re.sub(r' srcset="[^"]*"', "", drawn))
    parts = (
        f'<span class="column" style="--from: {start:.4f}; --width: {end - start:.4f}">'
        f"{unnamed if start else drawn}</span>"
        for start, end in columns
    )
    return f'<span class="whole-picture">{drawn}</span><span class="columns">{"".join(parts)}</span>'


def adapt_pictures(app: Any, page: str, template: str, context: dict[str, Any], doctree: object) -> None:  # noqa: ARG001
    """Adapt all pictures of a page."""
    folder = Path(app.srcdir)
    paths = {name: folder / source for source, name in app.builder.images.items()}

    def replaced(found: re.Match[str]) -> str:
        path = paths.get(found[1], folder / "auto_gallery/images" / found[1])
        path = path if path.exists() else path.parent / "thumb" / path.name
        return adapted(found[0], path) if path.exists() else found[0]

    if "body" in context:
        context["body"] = _IMAGE.sub(replaced, context["body"])


def _white(path: Path) -> Any:
    """Return the mask of the white pixels of a picture."""
    with Image.open(path) as image:
        return (np.asarray(image.convert("RGB")) >= _WHITE).all(axis=2)


def setup(app: Any) -> dict[str, Any]:
    """Connect the function to the build."""
    app.connect("html-page-context", adapt_pictures)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
