"""What an annotation takes of a raw value, what it refuses, and where in the value it says so."""

import math
from typing import Annotated, Any, Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.records import Length, Misfit, Within, expected, fit
from maipp.records.kinds import Ascending, Count, Each, Finite, Positive, Real

PAIRS = tuple[Real, Real] | Each[tuple[Real, Real]]


def refused(annotation: Any, value: Any, **how: Any) -> Misfit:
    with pytest.raises(Misfit) as caught:
        fit(annotation, value, **how)
    return caught.value


@pytest.mark.parametrize(
    ("annotation", "value", "made"),
    [
        (float, 3, 3.0),
        (Positive, np.float32(0.5), 0.5),
        (int, np.int64(4), 4),
        (PAIRS, [1, 2], (1.0, 2.0)),
        (PAIRS, np.array([[1, 2], [3, 4]]), ((1.0, 2.0), (3.0, 4.0))),
        (Positive | None, None, None),
        (Literal["a", "b"], np.str_("b"), "b"),
        (dict[str, Any], {"a": 1}, {"a": 1}),
        (Finite, 1e300, 1e300),
    ],
)
def test_values_become_what_the_annotation_says(annotation, value, made):
    got = fit(annotation, value)
    assert got == made and repr(got) == repr(made)


@pytest.mark.parametrize("kind", [int, float, Count, Real, Finite])
@pytest.mark.parametrize("value", [True, np.True_, math.nan, "3", None, [3], {}, 1 + 0j])
def test_what_is_no_number(kind, value):
    assert refused(kind, value).path == ()


@pytest.mark.parametrize("value", [math.inf, -math.inf, 10**400, 1e39])
def test_numbers_that_single_precision_does_not_hold(value):
    refused(Real, value)


@pytest.mark.parametrize(
    ("annotation", "value", "path", "problem"),
    [
        (Each[Positive] | Positive, [1, 2, -1], (2,), ""),
        (PAIRS, [[0, 0], 1], (1,), ""),
        (PAIRS, [0.1, math.nan], (1,), ""),
        (tuple[tuple[Real, ...], ...], [[1], [2, "x"]], (1, 1), ""),
        (Ascending[Count], [3, 2], (), "is an empty range, its low end above its high end"),
        (Positive, 1e-46, (), "is too small for single precision"),
        (Positive | None, 1e39, (), "is too large for single precision"),
        (Each[Real], [], (), ""),
        (Annotated[str, Length(1, 2)], "abc", (), ""),
    ],
)
def test_the_place_and_the_problem_are_told(annotation, value, path, problem):
    wrong = refused(annotation, value)
    assert (wrong.path, wrong.problem) == (path, problem)


@pytest.mark.parametrize(
    ("annotation", "text", "made"),
    [
        (float, "1e-6", 1e-6),
        (int, "12", 12),
        (bool, "Yes", True),
        (bool, "0", False),
        (float | None, "none", None),
        (tuple[float, ...], "(0.3, 0.4,)", (0.3, 0.4)),
        (tuple[float, ...], "", ()),
        (tuple[float, float | None], "0.3,none", (0.3, None)),
        (str, "3", "3"),
        (Literal[1, 2], "2", 2),
    ],
)
def test_texts_are_read_as_people_type_them(annotation, text, made):
    assert fit(annotation, text, typed=True) == made


@pytest.mark.parametrize(("annotation", "text"), [(int, "1.5"), (float, "nan"), (bool, "2"), (int, "9" * 5000)])
def test_texts_that_are_none_of_it(annotation, text):
    refused(annotation, text, typed=True)


@given(st.floats(), st.floats(), st.floats())
def test_bounds_hold(low, high, number):
    try:
        got = fit(Annotated[float, Within(least=low, most=high, wide=True)], number)
    except Misfit:
        assert not (low <= number <= high and math.isfinite(number))
    else:
        assert low <= got <= high and math.isfinite(got)


@pytest.mark.parametrize(
    ("annotation", "words"),
    [
        (Count, "a whole number >= 1"),
        (Positive | None, "a number > 0 or none"),
        (Annotated[int, Within(0, most=9)], "a whole number from 0 to 9"),
        (Annotated[Positive, "a length > 0"], "a length > 0"),
        (Literal["a", "b"], "one of a, b"),
        (tuple[float, ...], "a list such as 0.3,0.4"),
        (tuple[float, float | None], "2 values such as 0.3,none"),
        (bool, "true or false"),
    ],
)
def test_what_fits_is_said_in_words(annotation, words):
    assert expected(annotation) == words
