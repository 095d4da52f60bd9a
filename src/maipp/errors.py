"""Errors meant for the person who gave the input."""

import unicodedata

# Line breaks, terminal codes, halves of characters: what a broken file holds must not reach the terminal as it is.
_ESCAPED = ("Cc", "Cs", "Zl", "Zp")
_LONGEST = 1000  # characters; a file may hold "numbers" of 100,000 digits


class InputError(ValueError):
    """Bad input from a user: one line saying what is wrong, where, and what would be right.

    Whatever the input held, the text of the error is one printable line, its middle left out where it is very long.
    """

    def __str__(self) -> str:
        return one_line(super().__str__())


def one_line(text: str) -> str:
    """The text with control characters and line breaks escaped, and shortened in the middle to 1000 characters."""
    escaped = "".join(
        character.encode("unicode_escape").decode() if unicodedata.category(character) in _ESCAPED else character
        for character in _shortened(text)
    )
    return _shortened(escaped)


def first_line(error: Exception) -> str:
    """What an error of a reader says, short enough for a line of ours."""
    return (str(error).splitlines() or [type(error).__name__])[0][:200]


def _shortened(text: str) -> str:
    if len(text) <= _LONGEST:
        return text
    half = (_LONGEST - 5) // 2
    return f"{text[:half]} ... {text[-half:]}"
