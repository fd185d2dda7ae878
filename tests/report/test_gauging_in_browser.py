"""The pages of gauging in a browser: every figure is drawn, under the page's own policy."""

from __future__ import annotations

import re

import pytest

from selector.telling.page import write_account
from selector.telling.simulated import account_of
from tests.report import gaugings


@pytest.mark.parametrize(("kind", "figures"), [("line", 4), ("chain", 5)])
def test_every_figure_is_drawn_and_nothing_is_refused(kind, figures, shown, tmp_path):
    path = write_account(account_of(gaugings.page(kind), drawn=True), tmp_path / "page.html")
    content, said = shown(path)
    assert len(re.findall(r'<div class="plot[^"]*" id="(figure-\d+)"', content)) == figures
    drawn = re.sub(r"<script.*?</script>", "", content, flags=re.DOTALL)
    assert len(re.findall(r'<svg class="main-svg"', drawn)) >= figures
    assert said == []
