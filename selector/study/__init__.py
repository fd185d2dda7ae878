"""A study file: what was asked of which recordings, so that the answer can be made again, here or anywhere."""

from selector.study.asked import diagnose_section, export_section, options_of, overrides_of, select_section, study_of
from selector.study.inputs import Change, change_words, changes, require_unchanged
from selector.study.places import input_file, path_at, reference_to
from selector.study.study_file import (
    SCHEMA,
    DiagnoseSection,
    ExportSection,
    InputFile,
    ReadingSection,
    Recordings,
    SelectSection,
    Study,
    study_json_schema,
)
from selector.study.study_text import STUDY_FILE, parsed_study, read_study, study_place, study_text, write_study

__all__ = [
    "SCHEMA",
    "STUDY_FILE",
    "Change",
    "DiagnoseSection",
    "ExportSection",
    "InputFile",
    "ReadingSection",
    "Recordings",
    "SelectSection",
    "Study",
    "change_words",
    "changes",
    "diagnose_section",
    "export_section",
    "input_file",
    "options_of",
    "overrides_of",
    "parsed_study",
    "path_at",
    "read_study",
    "reference_to",
    "require_unchanged",
    "select_section",
    "study_json_schema",
    "study_of",
    "study_place",
    "study_text",
    "write_study",
]
