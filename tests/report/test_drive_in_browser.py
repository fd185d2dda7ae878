"""The pages of feed drives in a browser: every figure is drawn, polar ones too, under the page's own policy."""

from __future__ import annotations

import re

import pytest

from selector.telling.page import write_account
from selector.telling.simulated import account_of
from tests.report import drives


@pytest.mark.parametrize(("kind", "figures"), [("state", 3), ("circle", 4)])
def test_every_figure_is_drawn_and_nothing_is_refused(kind, figures, shown, tmp_path):
    path = write_account(account_of(drives.page(kind), drawn=True), tmp_path / "page.html")
    content, said = shown(path)
    assert len(re.findall(r'<div class="plot[^"]*" id="(figure-\d+)"', content)) == figures
    drawn = re.sub(r"<script.*?</script>", "", content, flags=re.DOTALL)
    assert len(re.findall(r'<svg class="main-svg"', drawn)) >= figures
    assert ("polarlayer" in drawn and 'class="polar"' in drawn) == (kind == "circle")
    assert said == []
