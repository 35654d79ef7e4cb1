"""Progress of long calls."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Optional, Union

from ._errors import InputError

Progress = Union[bool, Callable[[int], object], None]


@contextmanager
def telling(progress: Progress, total: Optional[int], unit: str) -> Iterator[Optional[Callable[[int], object]]]:
    """What to call with the number of parts done since the last call: a bar of tqdm for True, or the caller's own."""
    if progress is None or progress is False:
        yield None
    elif progress is True:
        try:
            from tqdm.auto import tqdm
        except ImportError:
            raise InputError("progress=True needs tqdm: pip install 'haptic-guidance[progress]'") from None
        with tqdm(total=total, unit=unit) as bar:
            yield bar.update
    elif callable(progress):
        yield progress
    else:
        raise InputError(f"progress: a {type(progress).__name__} is neither True nor callable")
