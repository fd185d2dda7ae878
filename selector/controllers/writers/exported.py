"""What a writer gives for one control."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from selector.controllers.writers.sign_test import SignTest
from selector.findings import Finding


@dataclass(frozen=True)
class Exported:
    """Files for a control, and what the person has to know who puts them there.

    Attributes
    ----------
    files : mapping of str to str
        Name → text. Programs are ASCII.
    install : tuple of str
        Steps on the control, in order: what to copy, wire, set; with units.
    sign_test : SignTest
        How the sign is proved on this control.
    silently : tuple of str
        What this control does without telling anybody: clips, spreads, forgets, jumps.
    findings : tuple of Finding
        What of the model this control cannot take, and what was done instead.
    """

    files: Mapping[str, str]
    install: tuple[str, ...]
    sign_test: SignTest
    silently: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()
