"""The answer to a measurement, and to what a person decides of one: what counts."""

from collections.abc import Mapping
from typing import Any

from maipp.live.effects import Effect
from maipp.live.events import Keep, Measurement, Withdraw
from maipp.live.gate import Verdict
from maipp.live.measurements import Measurements
from maipp.live.sample import Sample


def judged(event: Measurement | Withdraw | Keep, effect: Effect, measurements: Measurements) -> dict[str, Any]:
    """The answer to an event that is not yet among the measurements; `effect` is what it will change.

    `surprise` and, where it does not count, `gated` of a measurement; and the reports that count from now on and did
    not (`let_in`), or count no more (`put_out`).
    """
    answer: dict[str, Any] = {"answer": "noted", "id": event.id}
    before = _counted(measurements.verdicts())  # first, so that what is judged last is what will be there
    if effect.decision is not None and isinstance(event, Withdraw | Keep):
        after = measurements.verdicts(decided={event.measurement: effect.decision})
        answer["known"] = measurements.knows(event.measurement)
    else:
        assert effect.sample is not None
        after = measurements.verdicts((effect.sample, event.id))
        verdict = after.get(effect.sample)
        if verdict is None:
            answer["gated"] = "withdrawn"
        else:
            answer |= {} if verdict.surprise is None else {"surprise": round(verdict.surprise, 2)}
            answer |= {} if verdict.out is None else {"gated": verdict.out}
            answer |= {"repeats": verdict.run} if verdict.out == "stuck" else {}
    counted = _counted(after)
    let_in, put_out = (measurements.reports(each) for each in (counted - before - {effect.sample}, before - counted))
    return answer | ({"let_in": let_in} if let_in else {}) | ({"put_out": put_out} if put_out else {})


def _counted(verdicts: Mapping[Sample, Verdict]) -> set[Sample]:
    return {sample for sample, verdict in verdicts.items() if verdict.out is None}
