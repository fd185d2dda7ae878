"""Results and figures → one self-contained HTML file that opens without a network."""

from selector.report.prediction_report import prediction_html, write_prediction_report
from selector.report.selection_report import selection_html, write_report

__all__ = ["prediction_html", "selection_html", "write_prediction_report", "write_report"]
