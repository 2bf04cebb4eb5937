"""The letter reproduced number by number: its tables and figures beside ours, and where its text cannot be right."""

from .catalogue import IDS, reproduce
from .comparison import Comparison, Parameter, Verdict
from .page import letter_report_html, write_letter_report
from .result import DataTable, Evidence, Finding, LetterReport, Reproduction

__all__ = [
    "IDS",
    "Comparison",
    "DataTable",
    "Evidence",
    "Finding",
    "LetterReport",
    "Parameter",
    "Reproduction",
    "Verdict",
    "letter_report_html",
    "reproduce",
    "write_letter_report",
]
