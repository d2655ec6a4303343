"""Arrays of any dtype as those that the compiled estimators read, and time stamps as gaps."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _native

# Samples of one call of the compiled estimators. Between the calls Ctrl-C is noticed.
CHUNK = 1 << 20

# What the compiled estimators read where it is: integers of 1 to 8 bytes, floats of 4 and 8.
READ = frozenset("bhilqBHILQfd")

Grid = tuple[float, float]


# Samples that may be missing in a record: a longer gap is a mistake, and would never end.
LONGEST_GAP = 1 << 48


def check_gap(samples: int) -> int:
    """The number of missing samples, if it is one.

    Raises:
        ValueError: it is negative, or more than any record has.
    """
    if not 0 <= samples <= LONGEST_GAP:
        raise ValueError(f"a gap of {samples} samples: it must be 0 to 2**48")
    return int(samples)


def mask_of(samples: object) -> npt.NDArray[np.bool_] | None:
    """Which samples are masked; None without one."""
    if not isinstance(samples, np.ma.MaskedArray):
        return None
    mask = np.atleast_1d(np.ma.getmaskarray(samples))
    return mask if mask.any() else None


def masked_runs(mask: npt.NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Of each run of masked samples the index of the next one among those that are not, and its length."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False]))))
    starts, ends = edges[::2], edges[1::2]
    before = starts - np.concatenate(([0], np.cumsum(ends - starts)[:-1]))
    return list(zip(before.tolist(), (ends - starts).tolist(), strict=True))


def as_samples(samples: npt.ArrayLike) -> npt.NDArray[Any]:
    """The samples as an array of one dimension, without a copy if they are one. The mask of a masked array is not looked at."""
    array = np.asarray(samples)
    if array.dtype == object and array.size:
        # pandas has missing values of its own in its nullable types.
        to_numpy = getattr(samples, "to_numpy", None)
        if to_numpy is not None:
            array = to_numpy(dtype=np.float64, na_value=np.nan)
    if array.size == 0:
        return np.empty(0, dtype=np.int32)
    if array.ndim > 1:
        raise ValueError(f"samples have the shape {array.shape}: one channel has one dimension")
    if array.dtype.kind not in "iuf":
        raise TypeError(f"samples of the dtype {array.dtype}: they must be integers or floats")
    return np.atleast_1d(array)


def automatic_grid(array: npt.NDArray[Any]) -> Grid:
    """Origin and LSB for the floats of the first array that is pushed."""
    grid = _native.automatic_quantizer(readable(array[:CHUNK]))
    if grid is None:
        raise ValueError(
            "the first floats do not show how fine their grid must be, because no two neighbours differ: pass lsb=…"
        )
    return grid


def readable(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """The array, or a copy where the compiled estimators cannot read it: half and long floats, other byte orders, odd places."""
    known = array.dtype.char in READ
    if known and array.dtype.isnative and array.flags.aligned and array.strides[0] % array.itemsize == 0:
        return array
    return array.astype(array.dtype.newbyteorder("=") if known else np.float64)


def chunks(array: npt.NDArray[Any]) -> Iterator[tuple[npt.NDArray[Any], int]]:
    """The array in chunks, and the index of each one's first sample."""
    for first in range(0, len(array), CHUNK):
        yield readable(array[first : first + CHUNK]), first


def seconds(times: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Time stamps in s: numbers as they are, `datetime64` since 1970."""
    array = np.atleast_1d(np.asarray(times))
    if array.dtype.kind == "M":
        # Whole seconds apart from the rest: nanoseconds since 1970 exceed the 53 bits of a float.
        whole = array.astype("datetime64[s]")
        rest = (array - whole) / np.timedelta64(1, "s")
        start = whole[0] if len(whole) else np.datetime64(0, "s")
        return np.asarray((whole - start) / np.timedelta64(1, "s") + rest + float(start.astype(np.int64)))
    if array.dtype.kind not in "iuf":
        raise TypeError(f"times of the dtype {array.dtype}: they must be numbers of seconds or datetime64")
    return array.astype(np.float64)


def gaps(
    times: npt.NDArray[np.float64], previous: float | None, rate: float
) -> tuple[list[tuple[int, int]], float | None]:
    """Index of the sample after each gap and the number of missing ones, and the time at which the last one was expected.

    `previous` is that time for the samples before.
    """
    if not np.isfinite(times).all():
        raise ValueError(f"time stamp {int((~np.isfinite(times)).argmax())} is not finite")
    return _native.gaps(np.ascontiguousarray(times), rate, previous)


def check_rate(rate: float) -> float:
    """The rate, if it is one."""
    if not (np.isfinite(rate) and rate > 0.0):
        raise ValueError(f"rate is {rate}: it must be the samples per second, above 0")
    return float(rate)


def check_lsb(lsb: float) -> float:
    """The size of a count, if it is one."""
    if not (np.isfinite(lsb) and lsb > 0.0):
        raise ValueError(f"lsb is {lsb}: it must be the units per count, above 0")
    return float(lsb)
