"""Results and figures → one self-contained HTML file that opens without a network."""

from selector.report.selection_report import selection_html, write_report

__all__ = ["selection_html", "write_report"]
