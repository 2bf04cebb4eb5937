"""The letter reproduced number by number: its tables and figures beside ours, and where its text cannot be right.

`reproduce` computes, its `LetterReport` prints itself, and `pretouch.report.write_report` makes its page.
"""

from .experiment import IDS, Finding, LetterReport, Reproduction, Step, reproduce
from .printed import Agreement, Parameter, Printed

__all__ = ["IDS", "Agreement", "Finding", "LetterReport", "Parameter", "Printed", "Reproduction", "Step", "reproduce"]
