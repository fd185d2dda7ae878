# SIGN UNVERIFIED: do the sign test of the commissioning sheet before cutting.
# Model: patent CN1868666, two sensors
#   Z = -1.871 + 6.0476*dT1 + 2.6667*dT3 [um]
#   Y = 0.5703 + 4.7292*dT1 - 0.5908*dT3 [um]
# The correction of an axis is the negative of its displacement.
# Equations SHA-256 a6dda75b221d0a842068d1621f8510b36cdd362cdb3044be21d7c187f108c47f
# Written by selector
# Words for R5700 of a Mitsubishi M800, and what has to stand around them.
#
# EZSocket is not in here: give `write` and `read`, which call it. In the one
# deployment that is published (C#, EZNCAUTLib), write was
#     Device_WriteBlock(6, "R5700", 20, words)
# with the six words of an array, after SetTCPIPProtocol(address, 683) and
# Open2(system of the M800, 1, 1, "EZNC_LOCALHOST"). That call returns 0 when
# it is done: raise an error for anything else. Nothing here has been tried on
# a control by its authors.
import json
import os
import time

MODEL = 'a6dda75b221d0a842068d1621f8510b36cdd362cdb3044be21d7c187f108c47f'  # of what is kept; another model does not take it
AXES = ['Z', 'Y']  # of correction_1 ...; the block has X, Y, Z
CLAMPS_UM = [90.0, 54.0]  # of these
RETAINED = [
    'has_memory_1',
    'start_1',
    'has_start_1',
    'has_memory_2',
    'start_2',
    'has_start_2',
]
NO_READING = 1e+30
SAVE_EVERY_S = 300.0


class NotArrivedError(Exception):
    """The control holds other words than it was sent, or than it can have been sent."""


def words(corrections_um):
    """Six words of the corrections, in the order of AXES: per axis two's complement, the low word first [um]."""
    block = [0, 0, 0, 0, 0, 0]
    for axis, um in zip(AXES, corrections_um):
        whole = int(round(um))
        at = 2 * "XYZ".index(axis)
        block[at], block[at + 1] = (whole + 32768) % 65536 - 32768, whole >> 16
    return block


def micrometres(block):
    """What six words mean, in the order of AXES; a word may come with or without a sign."""
    found = []
    for axis in AXES:
        low, high = block[2 * "XYZ".index(axis)], block[2 * "XYZ".index(axis) + 1]
        whole = (high % 65536) * 65536 + low % 65536
        found.append(whole - 4294967296 if whole >= 2147483648 else whole)
    return found


def given(program, kind, values):
    """Values of all readings or positions of a program; None is one that is missing, never its last value."""
    count = 0
    while hasattr(program, "%s_%d" % (kind, count + 1)):
        count += 1
    if len(values) != count:
        raise ValueError("%d values of %s_1 ... were given, and the program has %d: give all of them, in the order of"
                         " the program, None for one that is missing" % (len(values), kind, count))
    for k, value in enumerate(values, 1):
        setattr(program, "%s_%d" % (kind, k), NO_READING if value is None else float(value))


class Offsets:
    """A program, cycle after cycle, into the words of the control.

    `write` takes six words; `read` gives the six that the control holds.
    `kept_file` outlives a restart of this computer.
    """

    def __init__(self, program, write, read, kept_file="m800_kept.json"):
        self.program, self.write, self.read = program, write, read
        self.kept_file, self.next_save_s = kept_file, SAVE_EVERY_S
        self._restored()
        # what stands in the control is taken over, held until sensors are believed, and goes on at the slew limit
        program.dt_s = 0.0
        program.is_ready = True
        program.step()
        program.is_restart = False
        held = list(read())
        for k, (um, clamp_um) in enumerate(zip(micrometres(held), CLAMPS_UM), 1):
            if abs(um) > clamp_um + 0.5:
                raise NotArrivedError("R5700 holds %r, %d um for %s, and this program sends %g at most: something else"
                                      " writes there, or a word is no micrometre; find out which, set the words to 0"
                                      " by hand, and start again" % (held, um, AXES[k - 1], clamp_um))
            setattr(program, "k0_%d" % k, float(um))
            setattr(program, "aim_%d" % k, float(um))

    def cycle(self, dt_s, readings, is_ready=True, positions_m=(), is_wanted=True):
        """One call, a second or less after the one before; None is a sensor without a reading. Gives what was sent."""
        program = self.program
        program.dt_s, program.is_ready, program.is_wanted = dt_s, is_ready, is_wanted
        given(program, "reading", readings)
        given(program, "position", positions_m)
        program.step()
        corrections = [getattr(program, "correction_%d" % (k + 1)) for k in range(len(AXES))]
        block = words(corrections)
        self.write(block)
        held = list(self.read())
        if micrometres(held) != micrometres(block):
            raise NotArrivedError("R5700 holds %r, and was sent %r: look at the data type of the call,"
                                  " and at the ladder for what else writes there" % (held, block))
        self.next_save_s -= dt_s if dt_s > 0.0 else 0.0  # NaN is no time
        if self.next_save_s <= 0.0:
            self.keep()
        return block

    def keep(self):
        """Start readings and memory go into `kept_file`, whole or not at all."""
        self.next_save_s = SAVE_EVERY_S
        kept = {name: getattr(self.program, name) for name in RETAINED}
        with open(self.kept_file + ".new", "w") as new:
            json.dump({"model": MODEL, "saved_at": time.time(), "kept": kept}, new)
        os.replace(self.kept_file + ".new", self.kept_file)

    def _restored(self):
        try:
            with open(self.kept_file) as old:
                found = json.load(old)
            if found["model"] != MODEL:
                return
            values = {name: type(getattr(self.program, name))(found["kept"][name]) for name in RETAINED}
            off_s = time.time() - float(found["saved_at"])
            if off_s < 0.0:
                off_s = 1e6  # a clock that was put back says nothing: as after a long standstill
        except (OSError, ValueError, KeyError, TypeError):
            return  # the first start, or damaged: start readings are taken anew
        for name, value in values.items():
            setattr(self.program, name, value)
        self.program.is_restart, self.program.standstill_s = True, off_s
