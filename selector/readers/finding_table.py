"""The findings of reading files: how much each matters, what it means and what to do about it."""

from selector.findings import Kinds
from selector.quality.finding_table import FINDINGS as QUALITY

AMBIGUOUS_TIME = "ambiguous-time"
CHANNELS_LACKING = "channels-lacking"
CLOCK_BACK, CLOCK_FORWARD = "clock-jump-back", "clock-jump-forward"
COLUMNS_IGNORED = "columns-ignored"
COLUMNS_WITHOUT_ROLE = "columns-without-role"
ROLES_GUESSED = "roles-guessed"
DUPLICATE_HEADER = "duplicate-header"
FILES_SKIPPED = "files-skipped"
MISSING_STAMPS = "missing-stamps"
RUN_REPAIRED = "run-repaired"
TWO_LOGGERS = "two-loggers"
REPEATED_STAMPS = "repeated-stamps"
TIME_UNIT_GUESSED = "time-unit-guessed"
UNIT_CONFLICT = "unit-conflict"
UNREADABLE_CELLS = "unreadable-cells"

FINDINGS = Kinds.beside(__file__)
FINDINGS["empty-channel"] = QUALITY["empty-channel"]
FINDINGS["sensor-break"] = QUALITY["sensor-break"]
