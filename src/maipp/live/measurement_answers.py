"""The answer to a measurement, and to what a person decides of one: what counts."""

from typing import Any

from maipp.live.effects import Effect
from maipp.live.events import Keep, Measurement, Withdraw
from maipp.live.measurements import MeasurementSet
from maipp.live.scaled_measurement import ScaledMeasurement


def judged(event: Measurement | Withdraw | Keep, effect: Effect, measurements: MeasurementSet) -> dict[str, Any]:
    """The answer to an event that is not yet among the measurements; `effect` is what it will change.

    `surprise` and, where it does not count, `gated` of a measurement; and the reports that count from now on and did
    not (`let_in`), or count no more (`put_out`).
    """
    answer: dict[str, Any] = {"answer": "noted", "id": event.id}
    before = measurements.verdicts()  # first, so that what is judged last is what will be there
    new: set[ScaledMeasurement] = set()
    if effect.decision is not None and isinstance(event, Withdraw | Keep):
        after = measurements.verdicts(decided={event.measurement: effect.decision})
        answer["known"] = measurements.knows(event.measurement)
    else:
        assert effect.sample is not None
        after = measurements.verdicts((effect.sample, event.id))
        new = set() if measurements.has(effect.sample) else {effect.sample}
        verdict = after.of(effect.sample)
        if verdict is None:
            answer["gated"] = "withdrawn"
        else:
            answer |= {} if verdict.surprise is None else {"surprise": round(verdict.surprise, 2)}
            answer |= {} if verdict.out is None else {"gated": verdict.out}
            answer |= {"repeats": verdict.run} if verdict.out == "stuck" else {}
    let_in, put_out = (
        measurements.reports(each) for each in (before.out - after.out - _of(effect), after.out - before.out - new)
    )
    return answer | ({"let_in": let_in} if let_in else {}) | ({"put_out": put_out} if put_out else {})


def _of(effect: Effect) -> set[ScaledMeasurement]:
    return set() if effect.sample is None else {effect.sample}
