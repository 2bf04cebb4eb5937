"""Reproduction of the letter: its tables and figures compared with computed ones, and errors in its text.

`reproduce` computes a `LetterReport`; `pretouch.report.write_report` writes its page.
"""

from .experiment import IDS, Finding, LetterReport, Reproduction, Step, reproduce
from .printed import Agreement, Parameter, Printed

__all__ = ["IDS", "Agreement", "Finding", "LetterReport", "Parameter", "Printed", "Reproduction", "Step", "reproduce"]
