"""Records from outside: scenarios, missions, configurations, events, episodes and options, read strictly.

A record is a dataclass whose fields say in their annotation what they take, and in their metadata what they mean. `fit`
makes what an annotation says of a raw value, or says what is wrong; `Value` is a raw value with the place it stands at;
`read_yaml` and `read_json` give the whole of a text as such a value.

No validation library is beneath it. msgspec refuses unions of two lists, such as one position or one per agent;
pydantic takes true and "3" for numbers unless strict, tells one mistake in such a union two or three times, and knows
neither lines nor what would be right. What both leave to do is most of this room.
"""

from maipp.records.assignments import assignments
from maipp.records.complaints import FieldError, nearest, show, unknown
from maipp.records.fields import Field, described, fields_of, refusal, settle
from maipp.records.fit import Check, Length, Misfit, Within, expected, fit
from maipp.records.json_text import pretty, read_json
from maipp.records.value import Value
from maipp.records.yaml_text import dump_yaml, read_yaml

__all__ = [
    "Check",
    "Field",
    "FieldError",
    "Length",
    "Misfit",
    "Value",
    "Within",
    "assignments",
    "described",
    "dump_yaml",
    "expected",
    "fields_of",
    "fit",
    "nearest",
    "pretty",
    "read_json",
    "read_yaml",
    "refusal",
    "settle",
    "show",
    "unknown",
]
