"""The drawings of a prediction: the duty cycle, the tests beside what the method makes of them, the modes."""

from selector.figures.duty_cycle import duty_cycle, prediction_of_tests, thermal_modes
from selector.physics.thermal.prediction.prediction import Prediction
from selector.telling.account import Block, Drawing

MOST_TESTS = 12


def drawings(prediction: Prediction) -> dict[str, list[Block]]:
    """Section of the account → its drawings."""
    names = prediction.responses
    modes = [drawn for name in names if (drawn := thermal_modes(prediction, name)) is not None]
    return {
        "cycle": [Drawing(duty_cycle(prediction, name), "" if i else _COURSE) for i, name in enumerate(names)],
        "tests": [_tests(prediction, name) for name in names] if prediction.repeats else [],
        "modes": [Drawing(drawn, "" if i else _MODES) for i, drawn in enumerate(modes)],
    }


def _tests(prediction: Prediction, response: str) -> Drawing:
    """All tests, or of many those that are repeated worst, in the order in which they were read."""
    r = prediction.responses.index(response)
    repeats = prediction.repeats
    ranked = sorted(range(len(repeats)), key=lambda k: -float(repeats[k].rmse_um[r]))[:MOST_TESTS]
    shown = tuple(repeats[k] for k in sorted(ranked))
    text = _TESTS
    if len(shown) < len(repeats):
        text += f" Of {len(repeats)} tests, the {len(shown)} that are repeated worst are drawn."
    return Drawing(prediction_of_tests(prediction, response, shown), text)


_MODES = (
    "The displacement in parts that settle with a time constant each: a short one follows the speed within minutes, a "
    "long one is the warmth that a machine keeps over breaks. What parts with similar time constants have each is less "
    "sure than their sum."
)
_COURSE = (
    "Top: the duty cycle. Middle: the predicted displacement; green: what the zeros of the operations and the "
    "corrections take off. Bottom: what is left of it; the band is the tolerance."
)
_TESTS = (
    "Each test is predicted as if it were a duty cycle, from rest and cold; the zero of the gauge is fitted, and where "
    "a finding says so the part of the hall temperature and the state at the start. The residual is measured minus "
    "predicted. All panels have the same scales."
)
