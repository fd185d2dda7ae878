"""Files → Recording. One file a format; what was inferred is always told and can be overridden."""

from selector.readers.machine_file import Machine as Machine
from selector.readers.machine_file import machine as machine
from selector.readers.machine_file import machine_text as machine_text
from selector.readers.reading import ChannelInfo as ChannelInfo
from selector.readers.reading import Reading as Reading
from selector.readers.reading import RunInfo as RunInfo
from selector.readers.reading import guessed_clock as guessed_clock
from selector.readers.reading import machine_of as machine_of
from selector.readers.reading import read as read
from selector.readers.stream import ParquetSource as ParquetSource
from selector.readers.stream import is_large as is_large
from selector.readers.stream import stream_parquet as stream_parquet
from selector.readers.tables import Overrides as Overrides
from selector.readers.writing import convert as convert
from selector.readers.writing import write_machine_file as write_machine_file
