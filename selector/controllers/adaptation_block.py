"""The part of a model file that says how touch-offs correct its outputs."""

from pydantic import Field

from selector.controllers.closed_values import Closed, Name, NonNegative, Positive


class OutputAdaptation(Closed):
    """How touch-offs correct one output: displacement = m + offset + gain · m, m as the model has it.

    Offset and gain are random walks that a Kalman filter follows; variances grow with the time between touch-offs.
    """

    output: Name
    offset_um2_per_s: NonNegative = Field(description="growth of the variance of the offset")
    offset_start_um2: NonNegative = Field(description="variance of the offset at a new start")
    gain_per_s: NonNegative = Field(default=0.0, description="growth of the variance of the gain")
    gain_start: NonNegative = Field(default=0.0, description="variance of the gain at a new start")
    noise_um2: Positive = Field(description="variance of one touch-off")
    offset_limit_um: Positive = Field(description="largest magnitude of the offset")
    gain_limit: NonNegative = Field(default=0.0, description="largest magnitude of the gain; 0: there is none")
    interval: Positive | None = Field(
        default=None, description="half width of a 90 % prediction interval in standard deviations"
    )


class Adaptation(Closed):
    """How the control keeps the model true with touch-offs."""

    outputs: tuple[OutputAdaptation, ...] = Field(min_length=1, max_length=32, fail_fast=True)
    gate: Positive = Field(
        default=4.0, description="a touch-off farther from what is expected, in standard deviations, is not believed"
    )
    agreeing: Positive = Field(
        default=0.5,
        description="but a second one is (beyond the limit of the offset a third), if it is nearer to the one before "
        "than this share of its way from what is expected",
    )
