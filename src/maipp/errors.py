"""Errors meant for the person who gave the input."""


class InputError(ValueError):
    """Bad input from a user: one line saying what is wrong, where, and what would be right."""
