"""Write the pages of the documentation that come from tables of the program: python docs/make_pages.py.

tests/contract/test_made_pages.py checks that the pages in the repository are the ones that this program writes.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from pretouch._core.warning_codes import WARNING_CODES, WarningCode

DOCS = Path(__file__).parent
MADE = "<!-- written by docs/make_pages.py -->"
GROUPS = {
    "PT1": "Calibration",
    "PT2": "What the calibration says about an answer",
    "PT3": "Design",
    "PT4": "Sampled loop",
    "PT5": "Robot models",
    "PT6": "Recordings",
    "PT9": "The letter",
}


def pages() -> Iterator[tuple[str, str]]:
    """Yield path and text of each page."""
    yield "warnings/README.md", warning_index()
    for code in WARNING_CODES.values():
        yield f"warnings/{code.code}.md", warning_page(code)


def warning_index() -> str:
    """Return the page that lists all warnings."""
    lines = [
        MADE,
        "# What a warning means",
        "",
        "Every warning of pretouch has a code, such as PT406. The terminal, the report and the field `warnings` of",
        "`--json` show the code. This page lists all codes. Each code has a page that says what it means, why it",
        "matters and what to do.",
        "",
    ]
    for start, title in GROUPS.items():
        lines += [f"## {title}", "", "| code | warning |", "| --- | --- |"]
        codes = [code for code in WARNING_CODES.values() if code.code.startswith(start)]
        lines += [f"| [{code.code}]({code.code}.md) | {code.title} |" for code in codes]
        lines.append("")
    return "\n".join(lines)


def warning_page(code: WarningCode) -> str:
    """Return the page of one warning."""
    return f"""\
{MADE}
# {code.code}: {code.title}

## What it means

{code.meaning}

## Why it matters

{code.why}

## What to do

{code.remedy}

## Example

```text
{code.code}: {code.example}
```

[All warnings](README.md)
"""


def main() -> None:
    """Write all pages."""
    for path, text in pages():
        target = DOCS / path
        target.parent.mkdir(exist_ok=True)
        target.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
