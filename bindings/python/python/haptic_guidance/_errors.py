"""Exceptions."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from typing import Any


class InputError(ValueError):
    """Input that cannot be used; the text names the field and what is wrong with it."""


class UnknownNameError(InputError, KeyError):
    """A name that there is not: of a field, of a column, of a parameter."""

    # A KeyError shows its text as one quotes a key.
    __str__ = Exception.__str__


class RangeError(InputError):
    """A value outside its range.

    Attributes
    ----------
    field : str
        The field, with the table that it is in.
    value, min, max : float
        The value, and the least and the largest allowed.
    unit : str
        Of all three; empty for a number without one.
    """

    def __init__(self, message: str, field: str, value: float, min: float, max: float, unit: str) -> None:
        super().__init__(message)
        self.field = field
        self.value = value
        self.min = min
        self.max = max
        self.unit = unit

    def __reduce__(self):
        return RangeError, (str(self), self.field, self.value, self.min, self.max, self.unit)


def unknown(place: str, name: object, known: Iterable[str]) -> UnknownNameError:
    """What to raise for a name that is none of those known in a place."""
    names = list(known)
    lowered = {known.lower(): known for known in names}
    close = get_close_matches(str(name).lower(), lowered, 1)
    hint = f"; did you mean {lowered[close[0]]!r}?" if close else "."
    return UnknownNameError(f"{place}: there is no {name!r}{hint} There are {', '.join(names)}")


def check_range(field: str, value: Any, min: float, max: float, unit: str) -> None:
    """Refuses what is no number of the range; NaN is none."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise InputError(f"{field}: {value!r} is no number") from None
    if not min <= number <= max:
        of = f" {unit}" if unit else ""
        raise RangeError(f"{field} = {number:g}{of} is outside {min:g} to {max:g}{of}", field, number, min, max, unit)
