"""The correction of one output as statements; statement by statement what `Correction` of the guard does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from selector.controllers.guard.codes import LARGEST_NUMBER, Mode
from selector.controllers.guard.decided import DecidedLimits
from selector.controllers.model_file import Output, PositionPart, Term
from selector.controllers.program.language import Expression, Real, Variable, Writing, is_code
from selector.controllers.signs import is_turned


class SlewedCorrection:
    """Variables and statements of the k-th output (from 1)."""

    def __init__(self, w: Writing, output: Output, limits: DecidedLimits, k: int) -> None:
        self._w, self._limits, self._name = w, limits, output.name
        self._is_turned = is_turned(output)
        self._test = w.variable(
            f"test_um_{k}", "real", "input", f"sign test of {output.name}: not 0 commands so much [um]"
        )
        self._tested = w.variable(f"tested_{k}")
        self._correction = w.variable(
            f"correction_{k}", "real", "output", f"to be added to the axis for {output.name} [um]"
        )
        self._k0 = w.variable(f"k0_{k}", "real", "output", "the same at the reference position [um]")
        self._aim = w.variable(f"aim_{k}", "real", "kept", "where it moves to [um]")
        self._rest = w.variable(f"rest_{k}", "real", "kept", "what rounding left of its last step [um]")
        self._along = None if output.position is None else _Along(w, output.position, k)

    @property
    def _moving(self) -> tuple[Variable, ...]:
        """What is 0 while the axis is not ready."""
        own, along = (self._k0, self._rest, self._correction), self._along
        return own if along is None else (*own, along.slope, along.rest, along.back_rest)

    def stopped(self) -> None:
        """The control was off: the correction begins at zero."""
        self._off()
        self.aimed_at_zero()

    def aimed_at_zero(self) -> None:
        """Whatever comes, it goes to zero."""
        self._w.assign(self._aim, 0.0)
        if self._along is not None:
            self._w.assign(self._along.aim, 0.0)

    def tested(self, is_test: Variable) -> None:
        """What is commanded by hand, 0 if nothing is; what is no number commands nothing."""
        w, test, clamp = self._w, self._tested, self._limits.clamp_um
        w.assign(test, 0.0)
        with w.when((self._test >= -LARGEST_NUMBER) & (self._test <= LARGEST_NUMBER)):
            w.assign(test, self._test)
        with w.when((test < 0.0) | (test > 0.0)):
            w.assign(is_test, True)
        w.limit(test, -clamp, clamp)

    def aimed(self, output: Output, z: Mapping[str, Variable]) -> None:
        """The output of the model, or of a fallback, is where it moves to from now on."""
        w, limits, along = self._w, self._limits, self._along
        own, change = w.variable("own"), w.variable("change")
        _polynomial(w, own, output.intercept, output.terms, z)
        self._turn(own)
        is_number = (own >= -LARGEST_NUMBER) & (own <= LARGEST_NUMBER)
        if along is not None:
            part, steep = output.position, w.variable("steep")
            _polynomial(w, steep, part.intercept if part else 0.0, part.terms if part else (), z)
            self._turn(steep)
            is_number = is_number & (steep >= -LARGEST_NUMBER) & (steep <= LARGEST_NUMBER)
        with w.when(is_number):
            w.limit(own, -limits.clamp_um, limits.clamp_um)
            w.assign(change, own - self._aim)
            with w.when((change >= limits.dead_band_um) | (change <= -limits.dead_band_um)):
                w.assign(self._aim, own)
            if along is not None and limits.reach_m > 0.0:
                steep, size, most = w.variable("steep"), w.variable("size"), w.variable("most")
                w.assign(size, self._aim)
                with w.when(self._aim < 0.0):
                    w.assign(size, -self._aim)
                w.assign(most, (Real(limits.clamp_um) - size) / limits.reach_m)
                w.at_most(most, limits.slope_clamp_um_per_m)
                w.limit(steep, -most, most)
                w.assign(along.aim, steep)

    def moved(self, mode: Variable, slewed: Variable, at: Mapping[str, Variable], back: Mapping[str, Variable]) -> None:
        """One call goes by.

        Parameters
        ----------
        mode, slewed : Variable
        at, back : mapping of str to Variable
            Per axis, its position, and whether that was lost and is there again.
        """
        w, limits, along = self._w, self._limits, self._along
        switched_off, is_test = is_code(mode, Mode.SWITCHED_OFF), is_code(mode, Mode.TEST)
        w.remark(f"correction of {self._name}: no faster than the slew limit")
        with w.when(is_code(mode, Mode.OFF)):
            self._off()
        with w.otherwise():
            if along is not None:
                self._carried(along, at[along.part.axis], back[along.part.axis])
            to = w.variable("towards")
            w.assign(to, self._aim)
            with w.when(switched_off):
                w.assign(to, 0.0)
            with w.when(is_test):
                w.assign(to, self._tested)
            _towards(w, self._k0, to, self._rest, slewed, limits.own_slew_um_per_s)
            if along is None:
                w.assign(self._correction, self._k0)
                return
            w.assign(to, along.aim)
            with w.when(switched_off | is_test):
                w.assign(to, 0.0)
            _towards(w, along.slope, to, along.rest, slewed, limits.slope_slew_um_per_m_s)
            w.assign(to, self._k0 + along.slope * (along.where - along.part.reference_m))
            w.limit(to, -limits.clamp_um, limits.clamp_um)
            with w.when(along.is_back):
                whole = w.variable("whole")
                w.assign(whole, to)
                _towards(w, self._correction, to, along.back_rest, slewed, limits.slew_um_per_s)
                w.assign(along.is_back, (self._correction < whole) | (self._correction > whole))
            with w.otherwise():
                w.assign(self._correction, to)

    def _off(self) -> None:
        for variable in self._moving:
            self._w.assign(variable, 0.0)
        if self._along is not None:
            self._w.assign(self._along.is_back, False)

    def _carried(self, along: _Along, at: Variable, back: Variable) -> None:
        """The correction moves with its axis; after its position was lost, no faster than the slew limit."""
        w, clamp, where = self._w, self._limits.clamp_um, self._w.variable("where")
        w.assign(where, at)
        w.limit(where, along.part.valid_min_m, along.part.valid_max_m)
        with w.when(back):
            w.assign(along.is_back, True)
        with w.otherwise():
            w.assign(self._correction, self._correction + along.slope * (where - along.where))
            w.limit(self._correction, -clamp, clamp)
        w.assign(along.where, where)

    def _turn(self, displacement: Variable) -> None:
        """The sign of the correction."""
        if not self._is_turned:
            self._w.assign(displacement, -displacement)


class _Along:
    """Variables of a position-dependent part."""

    def __init__(self, w: Writing, part: PositionPart, k: int) -> None:
        self.part = part
        self.slope = w.variable(f"slope_{k}", "real", "output", "and its slope [um/m]")
        self.aim = w.variable(f"slope_aim_{k}", "real", "kept", "where the slope moves to [um/m]")
        self.rest = w.variable(f"slope_rest_{k}", "real", "kept", "[um/m]")
        self.where = w.variable(f"where_{k}", "real", "kept", "position in the call before [m]", part.reference_m)
        self.is_back = w.variable(f"is_back_{k}", "flag", "kept", "position came back, correction is on its way")
        self.back_rest = w.variable(f"back_rest_{k}", "real", "kept", "[um]")


def _towards(w: Writing, now: Variable, to: Variable, rest: Variable, slewed: Variable, slew: float) -> None:
    """What rounding gives or takes of a step is made up for in the next."""
    most, reach, low, high = (w.variable(name) for name in ("most", "reach", "low", "high"))
    w.assign(most, Real(slew) * slewed + rest)
    w.assign(reach, most)
    w.at_least(reach, 0.0)
    w.assign(low, now - reach)
    w.assign(high, now + reach)
    w.assign(rest, 0.0)
    with w.when(to < low):
        w.assign(rest, most - (now - low))
        w.assign(to, low)
    with w.when(to > high):
        w.assign(rest, most - (high - now))
        w.assign(to, high)
    w.assign(now, to)


def _polynomial(
    w: Writing, total: Variable, intercept: float, terms: Sequence[Term], z: Mapping[str, Variable]
) -> None:
    w.assign(total, intercept)
    for term in terms:
        product: Expression = Real(term.coefficient)
        for name, power in term.powers.items():
            for _ in range(power):
                product = product * z[name]
        w.assign(total, total + product)
