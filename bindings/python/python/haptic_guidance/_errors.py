"""Exceptions."""

from __future__ import annotations

from typing import Any


class InputError(ValueError):
    """Input that cannot be used; the text names the field and what is wrong with it."""


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


def check_range(field: str, value: Any, min: float, max: float, unit: str) -> None:
    """Refuses what is no number of the range; NaN is none."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise InputError(f"{field}: {value!r} is no number") from None
    if not min <= number <= max:
        of = f" {unit}" if unit else ""
        raise RangeError(f"{field} = {number:g}{of} is outside {min:g} to {max:g}{of}", field, number, min, max, unit)
