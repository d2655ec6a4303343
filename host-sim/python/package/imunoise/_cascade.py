"""The streaming estimator of one channel."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _native
from ._curve import Curve
from ._samples import (
    Grid,
    as_samples,
    automatic_grid,
    check_gap,
    check_lsb,
    check_rate,
    chunks,
    gaps,
    mask_of,
    masked_runs,
    seconds,
)


class Cascade:
    """Streaming Allan variance at the averaging factors 1, 2, 4 … 2³⁰ samples, in 3 to 8 kB of memory.

    Integers are counts. They are summed exactly: neither the length of the record nor an offset costs a digit.

    Floats are rounded to the counts of a grid, `origin + count·lsb`. Without `lsb` the first array of floats decides:
    the origin is its first value, and the LSB is the largest power of two below 1/65536 (`float32`: 1/256) of the root
    mean square of `(x[i+1] − x[i])/√2`, so that rounding adds 2·10⁻¹¹ (1.3·10⁻⁶) of the variance of white noise. A later
    value more than 2³¹ steps from the origin raises `OverflowError`. With `lsb`, integers are values on that grid too.

    Args:
        overlap: differences per averaging time: 1 (none), 2, 4, 8 or 16. With 8, at least 98 % of the degrees of freedom
            of the fully overlapping estimator remain.
        lsb: units per count.
        origin: value of the count 0.

    A `Cascade` can be copied and pickled: the copy continues to the bit. Its methods release the global interpreter lock, and
    may be called by several threads at once: the arrays are added one after the other.
    """

    __slots__ = ("_estimator", "_fixed_grid", "_grid", "_last_time", "_lock", "_overlap")

    def __init__(self, overlap: int = 8, *, lsb: float | None = None, origin: float = 0.0) -> None:
        self._estimator = _native.Estimator(overlap)
        self._overlap = overlap
        if not np.isfinite(origin):
            raise ValueError(f"origin is {origin}: it must be finite")
        self._fixed_grid: Grid | None = None if lsb is None else (float(origin), check_lsb(lsb))
        self._grid = self._fixed_grid
        self._last_time: float | None = None
        self._lock = threading.Lock()

    def push(
        self, samples: npt.ArrayLike, *, times: npt.ArrayLike | None = None, rate: float | None = None
    ) -> None:
        """Adds samples in order: a number, or an array of any integer or float dtype, strided or not, or a pandas series.

        NaN, or the mask of a masked array, marks a missing sample. With `times` (in s, or `datetime64`) and the nominal `rate` in Hz, samples are also
        missing where no time stamp is near a time at which one is expected, between calls too. The expected times follow
        the stamps: a rate that is off by up to 1 % is followed, and a jitter of a quarter of a period tolerated.

        Either all samples are added or, if an exception is raised (Ctrl-C included), none.

        Raises:
            TypeError: the dtype is neither integer nor float, or counts and floats are mixed without an `lsb`.
            OverflowError: a sample does not fit in 32 bits.
            ValueError: a sample is infinite, the array has more than one dimension, time stamps do not rise.
        """
        array, mask = as_samples(samples), mask_of(samples)
        if mask is not None:
            array = array[~mask]
        stamps = None if times is None else seconds(times)
        if stamps is not None and mask is not None and len(stamps) == len(mask):
            stamps = stamps[~mask]
        with self._lock:
            self._add(array, [] if mask is None else masked_runs(mask), stamps, rate)

    def _add(
        self,
        array: npt.NDArray[Any],
        masked: list[tuple[int, int]],
        stamps: npt.NDArray[np.float64] | None,
        rate: float | None,
    ) -> None:
        estimator, grid, last_time = self._estimator.copy(), self._grid, self._last_time
        if len(array) and grid is None and array.dtype.kind == "f":
            taken, missing, _ = estimator.samples()
            if taken or missing:
                raise TypeError("floats after counts: pass lsb=… to Cascade, which makes all samples values in the unit")
            grid = automatic_grid(array)
        if len(array) and self._fixed_grid is None and grid is not None and array.dtype.kind != "f":
            raise TypeError("counts after floats: pass lsb=… to Cascade, which makes all samples values in the unit")
        if stamps is None:
            _push_with_gaps(estimator, array, grid, masked)
        else:
            if rate is None:
                raise TypeError("times need the nominal rate in Hz")
            if len(stamps) != len(array):
                raise ValueError(f"{len(stamps)} time stamps for {len(array)} samples")
            if len(array):
                found, last_time = gaps(stamps, last_time, check_rate(rate))
                _push_with_gaps(estimator, array, grid, found)
        self._estimator, self._grid, self._last_time = estimator, grid, last_time

    def gap(self, samples: int) -> None:
        """Says that so many samples are missing before the next one.

        Long averaging times bridge the gap, short ones leave out what it touches.
        """
        missing = check_gap(samples)
        with self._lock:
            self._estimator.gap(missing)

    def merge(self, later: Cascade) -> None:
        """Adds the sums of another estimator, which has seen a later stretch of the same channel.

        Both must have the same overlap and the same grid. No difference contains samples of both stretches.
        """
        with later._lock:  # both may be the same
            added, grid, last_time = later._estimator.copy(), later._grid, later._last_time
        with self._lock:
            other = added.samples()[0]
            if len(self) and other and self._grid != grid:
                raise ValueError(f"different grids (origin, lsb): {self._grid} and {grid}")
            self._estimator.merge(added)
            self._grid = grid if other else self._grid
            self._last_time = last_time

    def curve(self, rate: float, lsb: float | None = None) -> Curve:
        """The Allan deviation at every averaging time.

        Args:
            rate: samples per second.
            lsb: units per count; 1 by default. Floats are in their unit already, and take none.
        """
        if lsb is not None and self._grid is not None:
            raise ValueError("lsb is the units per count, but the samples were values in the unit")
        scale = self._grid[1] if self._grid is not None else 1.0 if lsb is None else check_lsb(lsb)
        return Curve(self._estimator.curve(1.0 / check_rate(rate), scale))

    def __len__(self) -> int:
        """Samples taken."""
        return self._estimator.samples()[0]

    @property
    def missing(self) -> int:
        """Samples reported missing."""
        return self._estimator.samples()[1]

    @property
    def replaced(self) -> int:
        """Missing samples that the curve replaces: those in gaps that its longer averaging times bridge."""
        return self._estimator.samples()[2]

    @property
    def is_saturated(self) -> bool:
        """Whether a sum of squares is full, so that the curve is a lower bound there."""
        return self._estimator.is_saturated()

    @property
    def overlap(self) -> int:
        """Differences per averaging time."""
        return self._overlap

    @property
    def quantizer(self) -> tuple[float, float] | None:
        """Origin and LSB of the grid; None as long as samples are counts."""
        return self._grid

    def __repr__(self) -> str:
        grid = "" if self._grid is None else f", origin={self._grid[0]!r}, lsb={self._grid[1]!r}"
        return f"<Cascade: {len(self)} samples, {self.missing} missing, overlap={self._overlap}{grid}>"

    def __getstate__(self) -> tuple[Any, ...]:
        with self._lock:
            return (self._overlap, self._estimator.state(), self._fixed_grid, self._grid, self._last_time)

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        self._overlap, estimator, self._fixed_grid, self._grid, self._last_time = state
        self._estimator = _native.Estimator.from_state(self._overlap, estimator)
        self._lock = threading.Lock()


def curve(
    samples: npt.ArrayLike,
    rate: float,
    *,
    lsb: float | None = None,
    overlap: int = 8,
    times: npt.ArrayLike | None = None,
) -> Curve:
    """The Allan deviation of `samples` at `rate` per second, as a `Cascade` computes it.

    `lsb` is the units per count for integers. Floats get a grid of their own, as `Cascade` describes.
    """
    cascade = Cascade(overlap)
    cascade.push(samples, times=times, rate=None if times is None else rate)
    return cascade.curve(rate, lsb)


def _push(estimator: _native.Estimator, array: npt.NDArray[Any], grid: Grid | None, start: int) -> None:
    for data, first in chunks(array):
        estimator.push(data, grid, start + first)


def _push_with_gaps(
    estimator: _native.Estimator, array: npt.NDArray[Any], grid: Grid | None, found: list[tuple[int, int]]
) -> None:
    start = 0
    for index, missing in found:
        _push(estimator, array[start:index], grid, start)
        estimator.gap(check_gap(missing))
        start = index
    _push(estimator, array[start:], grid, start)
