import pickle

from hypothesis import given
from hypothesis import strategies as st

from maipp.errors import InputError, one_line


@given(st.text(st.characters(), max_size=3000))
def test_whatever_the_input_held_the_error_is_one_printable_line(text):
    told = str(InputError(f"file.csv, line 3: {text}"))
    assert told.startswith("file.csv, line 3: ") and len(told.splitlines()) == 1 and len(told) <= 1000
    told.encode("utf-8")  # as a terminal does
    assert not any(character < " " or "\x7f" <= character < "\xa0" for character in told)


def test_plain_text_is_left_alone():
    text = "mesure.csv: 'température (°C)' 水温 👩‍🔬: é"
    assert str(InputError(text)) == text == one_line(text)


def test_the_end_of_a_long_text_says_what_would_be_right():
    told = one_line("file: " + "9" * 5000 + " is too large; give a number below 10")
    assert told.startswith("file: 999") and " ... " in told and told.endswith("; give a number below 10")


def test_escapes_are_readable():
    assert str(InputError("a\nb\x1b[31m\u2028\ud800")) == r"a\nb\x1b[31m\u2028\ud800"


def test_it_survives_pickling():
    assert str(pickle.loads(pickle.dumps(InputError("a\tb")))) == r"a\tb"
