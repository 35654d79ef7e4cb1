"""Sweeps on any engine that takes functions: this machine's cores, Dask, MPI, a queue."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, Optional, Union

from ._native import Sweep
from ._progress import telling

__all__ = ["SweepResult", "sweep"]


@dataclass(frozen=True)
class SweepResult:
    """What a sweep left.

    Attributes
    ----------
    directory : Path
        Holds ``drives.parquet``, ``drives.csv``, ``sweep.toml`` and the chunks.
    summary : dict
        Distributions, shares of the variance, Sobol indices, the worst drives.
    """

    directory: Path
    summary: dict[str, Any]

    @property
    def parquet(self) -> Path:
        """The table, a row a drive: ``pandas.read_parquet(result.parquet)``.

        Raises
        ------
        FileNotFoundError
            The package was built without Parquet.
        """
        table = self.directory / "drives.parquet"
        if not table.exists():
            raise FileNotFoundError(
                f"{table}: this package was built without Parquet, which `cargo xtask wheel --dist` has; {self.csv} has the same rows"
            )
        return table

    @property
    def csv(self) -> Path:
        """The same as CSV."""
        return self.directory / "drives.csv"


@lru_cache(maxsize=4)
def _known(text: str) -> Sweep:
    return Sweep.from_text(text)


def _drive(text: str, number: int, attempt: int) -> bytes:
    """What a worker does: one chunk, from the text and its number alone. Dask takes equal calls for one, so attempts
    have numbers."""
    return _known(text).run_chunk(number)


def _wait(futures: list[Any]) -> list[Any]:
    """Futures that are done, of any engine."""
    try:
        return list(wait(futures, return_when=FIRST_COMPLETED).done)
    except (AttributeError, TypeError):
        # Not those of concurrent.futures: Dask's are, by another function.
        from distributed import wait as wait_for

        return list(wait_for(futures, return_when="FIRST_COMPLETED").done)


def sweep(
    spec: Union[str, os.PathLike[str]],
    executor: Optional[Any] = None,
    *,
    out: Union[str, os.PathLike[str]] = "out/sweep",
    in_flight: int = 256,
    retries: int = 3,
    progress: Union[bool, Callable[[int, int], None], None] = None,
) -> SweepResult:
    """Drive a sweep, or what is missing of it.

    Parameters
    ----------
    spec : path
        The sweep file, as ``host-sim sweep`` takes it (docs/sweeps.md).
    executor : object with ``submit``, optional
        Who drives: an executor of ``concurrent.futures``, a Dask ``Client``, ``mpi4py.futures``. Workers need this
        package and nothing else: no file and no directory. Without one: threads, one a core.
    out : path
        Directory of the results. A sweep that was interrupted there goes on where it was.
    in_flight : int
        Chunks that are handed out at once.
    retries : int
        How often a chunk is handed out again whose worker died.
    progress : bool or callable, optional
        True shows a bar (needs tqdm); a callable is called with the number of chunks done and of all, behind each.

    Returns
    -------
    SweepResult
        The same bytes as ``host-sim sweep`` of the same version leaves, whatever the engine.

    Raises
    ------
    InputError
        The file, the field, its value and its range.
    """
    plan = Sweep.load(spec)
    out = Path(out)
    todo = plan.missing(out)
    with telling(progress if isinstance(progress, bool) else None, len(todo), "chunks") as bar:
        tell = progress if bar is None else lambda done, of: bar(1)
        if executor is None:
            with ThreadPoolExecutor(os.cpu_count()) as threads:
                submit = lambda text, number, attempt: threads.submit(plan.run_chunk, number)
                try:
                    _drive_all(plan, todo, submit, out, in_flight, retries, tell or None)
                except BaseException:
                    # Leaving the block waits for the threads.
                    plan.stop()
                    raise
        else:
            _drive_all(plan, todo, partial(executor.submit, _drive), out, in_flight, retries, tell or None)
    return SweepResult(out, plan.finish(out))


def _drive_all(
    plan: Sweep,
    todo: list[int],
    submit: Callable[[str, int, int], Any],
    out: Path,
    in_flight: int,
    retries: int,
    progress: Optional[Callable[[int, int], None]],
) -> None:
    text, done = plan.text, plan.chunks - len(todo)
    left = {number: retries for number in todo}
    todo = todo[::-1]
    running: dict[Any, int] = {}
    try:
        while todo or running:
            while todo and len(running) < in_flight:
                number = todo.pop()
                running[submit(text, number, left[number])] = number
            for future in _wait(list(running)):
                number = running.pop(future)
                try:
                    chunk = future.result()
                except ValueError:
                    # Bad input stays bad.
                    raise
                except Exception:
                    left[number] -= 1
                    if left[number] < 0:
                        raise
                    todo.append(number)
                    continue
                plan.put(out, number, chunk)
                done += 1
                if progress is not None:
                    progress(done, plan.chunks)
    finally:
        # After an error or an interrupt nobody waits for these.
        for future in running:
            future.cancel()
