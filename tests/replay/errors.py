"""Errors of inputs, with file and field in one line."""


class Unusable(Exception):
    """A file that cannot be used; the message names file and field."""


def field_error(error):
    """Message of a failed look-up; KeyError alone prints only the key."""
    if isinstance(error, KeyError):
        return f"field {error.args[0]} is missing"
    if isinstance(error, ValueError):
        return str(error)
    return f"{type(error).__name__}: {error}"
