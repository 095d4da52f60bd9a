"""Markdown that commands write: tables line up, numbers keep what errors show, and places on a page alone change."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from maipp.errors import InputError
from maipp.markdown import filled, markdown_table, mean_and_error, three, typed

START, END = "<!-- a:start -->", "<!-- a:end -->"


def test_words_are_to_the_left_and_numbers_to_the_right():
    assert markdown_table(["a", "b", "c"], [["x", "1", "2"]], left=1).splitlines() == [
        "| a | b | c |",
        "| --- | ---: | ---: |",
        "| x | 1 | 2 |",
    ]
    assert "| --- | --- |" in markdown_table(["a", "b"], [], left=2)


def test_the_page_is_changed_between_its_marks_alone():
    once = filled(f"before\n{START}\nold\n{END}\nafter\n", START, END, "x")
    assert once == f"before\n{START}\n\nx\n\n{END}\nafter\n"
    assert filled(once, START, END, "x") == once


@pytest.mark.parametrize("text", ["", START, END, f"{END} {START}"])
def test_a_page_without_marks_is_refused(text):
    with pytest.raises(InputError, match=f"p.md: no place for b; add the lines {START} and {END} to it"):
        filled(text, START, END, "x", "p.md", "b")


def test_values_are_as_one_types_them():
    values = (None, True, 0.25, "x", (1, [2, False]))
    assert [typed(value) for value in values] == ["none", "true", "0.25", "x", "1,2,false"]


@given(st.floats(0.01, 900), st.floats(1e-4, 50))
def test_mean_and_error_lose_nothing_that_the_error_shows(mean, se):
    shown_mean, shown_se = map(float, mean_and_error(mean, se).split(" ± "))
    assert abs(shown_mean - mean) <= 0.051 * se
    assert shown_se == pytest.approx(se, rel=0.051)
    assert math.isclose(float(mean_and_error(mean, None)), mean, rel_tol=0.006)


def test_three_digits_without_a_trailing_point():
    assert [three(number) for number in (0.012345, 1.5, 20.0, 123.4)] == ["0.0123", "1.50", "20.0", "123"]
