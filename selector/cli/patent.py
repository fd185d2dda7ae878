"""`audit-patent`: does the patent agree with itself, number by number."""

from __future__ import annotations

from collections import Counter

from selector.cli.shared import showing
from selector.cli.shared.showing import AsJson


def audit_patent(as_json: AsJson = False) -> None:
    """Checks every number that patent CN1868666 prints: printed value, our value, agrees or contradicts, and why.

    Contradictions are news about the patent, not about this program: the exit code is 0 all the same.
    """
    from selector.audit import audit_patent as audited
    from selector.audit import audit_table_text

    lines = audited()
    if as_json:
        verdicts = Counter(line.verdict for line in lines)
        showing.print_json(
            {"schema": "selector.patent-audit/1", "verdicts": verdicts, "lines": [line.as_dict() for line in lines]}
        )
        return
    console = showing.screen()
    console.print(audit_table_text(lines, width=console.width), markup=False, soft_wrap=True)
