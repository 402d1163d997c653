"""The report of a closed loop: a page for people and the same numbers for programs."""

from hil.app.report.numbers import report_json
from hil.app.report.page import report_html
from hil.app.report.words import headline

__all__ = ["headline", "report_html", "report_json"]
