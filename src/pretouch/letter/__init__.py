"""Recompute the tables and figures of the published letter.

Also list the errors in its text. `reproduce` computes a `LetterReport`; `pretouch.report.write_report` writes its page.
"""

from .experiment import Finding, LetterReport, Reproduction, Step
from .parts import IDS, reproduce
from .printed import Agreement, Parameter, Printed

__all__ = ["IDS", "Agreement", "Finding", "LetterReport", "Parameter", "Printed", "Reproduction", "Step", "reproduce"]
