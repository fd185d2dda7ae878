"""The findings of reading files: how much each matters, what it means and what to do about it."""

from selector.findings import Kinds
from selector.quality.finding_table import FINDINGS as QUALITY

AMBIGUOUS_TIME = "ambiguous-time"
CHANNELS_LACKING = "channels-lacking"
CLOCK_BACK, CLOCK_FORWARD = "clock-jump-back", "clock-jump-forward"
COLUMNS_IGNORED = "columns-ignored"
COLUMNS_WITHOUT_ROLE = "columns-without-role"
FILES_SKIPPED = "files-skipped"
MISSING_STAMPS = "missing-stamps"
RUN_REPAIRED = "run-repaired"
REPEATED_STAMPS = "repeated-stamps"
TIME_UNIT_GUESSED = "time-unit-guessed"
UNIT_CONFLICT = "unit-conflict"
UNREADABLE_CELLS = "unreadable-cells"

FINDINGS = Kinds.of(
    """
read-in-pieces [info] the recordings are large and were read in pieces; faults were looked for in a part of the rows
run-outside-window [info] of a run next to nothing lies in the window, or it is shorter than two means
    → widen the window, or take means over fewer seconds
window-begins-in-run [info] the window begins within a run
    → begin the window where runs begin, if the machine has to be cold there
means-taken [info] means over some seconds were taken in place of samples, as asked
opaque-objects [warning] a MAT file holds objects that only MATLAB can read; they are left out
    → convert them to plain vectors in MATLAB
other-length [info, warning] variables or channels have another number of samples than the rest of the file; they are
    left out
nested-columns [info] columns of a Parquet file hold no plain numbers, times or texts; they are left out
groups-are-runs [warning] a TDMS file has several groups of channels; each is a run of its own
    → name one group (--sheet) to read only that one
unreadable-cells [warning] a column has cells that are no numbers; they are missing values
    → correct these cells, or tell the logger to leave missing values empty
grouped-thousands [warning] numbers are read as whole numbers with grouped thousands
    → if this mark is the decimal mark, name it (--decimal)
mixed-decimal [warning] some numbers have another decimal mark than the rest of the file
    → export the whole file with one decimal mark
unit-in-cells [info] the cells of a column carry a unit; it is read from them
infinite-values [warning] a column has infinite values; they are missing values
words-as-numbers [info] a column holds words, such as on and off, that are read as numbers
ball-bar-unit-assumed [info] a column of a ball-bar file has no unit; one was assumed
    → write the unit into its heading: deviation_um, deviation_mm, feed_mm_per_min
uff-no-such-node [warning] a node of --point is in no file
    → correct the number of the node
uff-left-out [info] datasets of UFF files are not used
    → Look whether one of them should count: its type, its direction (--axis), its node (--point).
no-header [warning] a table has no row of channel names; the columns are numbered
    → name the columns in a machine file, or the row that holds the names (--header-row)
time-column-guessed [warning] no column is called a time; one that rises in equal steps is taken for it
    → name the time column and its unit under [time] in the machine file (or --time-column, --time-unit)
zero-bytes [warning] zero bytes stand in a text file; they are left out
    → look at the samples there: a logger that lost power writes them, and readings may be missing
stated-period [info] a file has no time column; the sampling interval that its heading states was taken
    → if it is wrong: period_s = 60 under [time] in the machine file (or --period-s 60)
no-clock [warning] a file has no time column; one row per second is assumed
    → set the sampling period: period_s = 60 under [time] in the machine file (or --period-s 60)
time-unit-guessed [warning] the unit of the time column is not written; one is assumed
    → Name it: unit under [time] in the machine file (or --time-unit).
absolute-clock [info] the time column counts from a date that is known: the run has a date
ambiguous-time [warning] times could be hours:minutes or minutes:seconds
    → if they are minutes:seconds, say unit = "min" under [time] in the machine file (or --time-unit min); if not, unit
      = "datetime"
time-unit-conflict [warning] the machine file or an option says another unit of the time than the file itself
    → correct [time] unit in the machine file
several-clocks [warning] the channels of a file are recorded on several clocks; they are interpolated onto one
    → export the recording on one clock if fast changes matter
ambiguous-date [warning] dates could be read in another order of day and month
    → Name the order of the date: date_order under [time] in the machine file, or --date-order.
missing-stamps [warning] rows have no readable time; they are left out
    → correct the time in these rows, or delete summary lines from the file
midnight-wrap [info, warning] the time of day passes midnight (or noon) without a date; the run goes on behind it
    → write the date with the time to make this sure
unsorted-stamps [info, warning] the rows are not in order of time; they are sorted
    → check that the file was not put together from several recordings
clock-jump-back [warning] the clock of a file jumps back; the time behind the jump is moved on
    → if two recordings were put into one file, split it there into two runs
clock-jump-forward [warning] the clock jumps forward by one hour in the night when summer time begins; the hour is taken
    out
    → if the logger really paused for an hour, write stamps in UTC
coarse-stamps [warning] the time stamps are coarser than the sampling; the rows are spread evenly between them
    → let the logger write fractions of a second
repeated-rows [info] rows stand in the file more than once; each is taken once
repeated-stamps [warning] rows have the stamp of another row but other values
    → let the logger write finer stamps, or remove the wrong rows
files-skipped [info] files of a folder are no recordings by their names
    → name a file itself to read it whatever its name
units-differ [info, warning] the runs have different units for a channel; each is read in its own
    → Nothing to do if the headers are right; else correct them in the files, or name the unit with --unit.
unit-conflict [warning] the machine file or an option says another unit of a channel than the headers
    → Correct the unit in the machine file, or the headers.
ambiguous-role [warning] it is uncertain what a channel measures
    → Say what it is in a machine file: column, role and unit of this channel.
channel-missing-in-run [warning] a channel is missing in some runs; its samples there are missing values
    → leave the channel or these runs out if a model needs it
channels-lacking [info] channels of the machine file are in none of the files
columns-ignored [info] columns of the files are not in the machine file; they are not read
    → declare them in the machine file to use them
text-columns [info] columns hold text; they are not read
auxiliary-columns [info] columns number the samples or are further clocks; they are no channels
roles-guessed [info] no machine file says what the channels are; names, units and numbers decide
    → check them: selector describe FILE --write machine.toml writes a machine file to correct
columns-without-role [warning] nothing tells what some columns measure; they are not read
    → give them a role in a machine file
unit-guessed [warning] neither the machine file nor the files say the unit of a channel; one is assumed
    → add unit = ... to this channel in the machine file
unknown-unit [warning] the unit of a column is not known; it is not used
    → name the unit in the machine file
machine-file-found [info] the machine file in the folder of the recordings is used
    → name another one (--machine) to use that instead
run-not-used [info] the machine file leaves a run out
run-repaired [info] a run was read as the machine file repairs it
repair-of-no-run [info] the machine file repairs a run that was not read
    → correct the name in [runs.NAME], or leave it for the recordings that have this run
repair-of-no-sample [warning] a stretch that the machine file leaves out is not in its run
    → count it in seconds from the start of the run
run-column [info] a column tells several runs of one file apart
runs-renamed [info] several files have the same name; their runs get names that differ
    → give the files different names
run-name-changed [info] names of runs are too long, or have characters that cannot be shown
    → rename the files
duplicate-header [warning] several columns have the same name; the later ones get new names
    → give every channel its own name in the file, or refer to the new names in the machine file
unnamed-first-column [warning] a header has one name less than there are columns; the first column is read as row
    numbers
    → write a name above each column
header-too-long [warning] a header has more names than the lines have cells; the last names are left out
    → check that each name stands above its column
encoding-guessed [info, warning] a text is not UTF-8; its encoding is guessed
    → if the names look wrong, name the encoding (--encoding)
undecodable-bytes [warning] some bytes of a text are not valid in its encoding
    → check whether the file was cut off, or name its encoding (--encoding)
ragged-rows [warning] lines have too few cells; the cells that are not there are missing values
    → check whether the logger was stopped or cells were lost at these lines
overlong-rows [warning] lines have too many cells; they are left out
    → correct these lines in the file
repeated-header [info] the header is repeated between the samples; these lines are left out
    → if two recordings were pasted into one file, split them into two runs
text-lines [warning] lines between the samples are text; they are left out
    → check whether they mark the beginning of another recording
comment-lines [info] comment lines between the samples are left out
ambiguous-decimal [warning] every number with a comma or point has three digits behind it: decimals or grouped thousands
    → If the numbers are 1000 times too small, name the other decimal mark (--decimal).
sheets-are-runs [info] several sheets of a workbook have the same columns; each is a run of its own
    → name one sheet (--sheet) to read only that one
sheets-left-out [info, warning] sheets of a workbook have other columns or no table of numbers; they are not read
    → name the sheet to read (--sheet)
"""
)
FINDINGS["empty-channel"] = QUALITY["empty-channel"]
FINDINGS["sensor-break"] = QUALITY["sensor-break"]
