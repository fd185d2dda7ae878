"""Files → Recording. One file a format; what was inferred is always told and can be overridden."""

from selector.readers.machine_file import Machine, machine, machine_text
from selector.readers.reading import ChannelInfo, Reading, RunInfo, guessed_clock, machine_of, read
from selector.readers.stream import ParquetSource, is_large, stream_parquet
from selector.readers.tables import Overrides
from selector.readers.writing import convert, write_machine_file

__all__ = [
    "ChannelInfo",
    "Machine",
    "Overrides",
    "ParquetSource",
    "Reading",
    "RunInfo",
    "convert",
    "guessed_clock",
    "is_large",
    "machine",
    "machine_of",
    "machine_text",
    "read",
    "stream_parquet",
    "write_machine_file",
]
