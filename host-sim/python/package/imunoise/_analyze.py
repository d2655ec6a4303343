"""The analysis of a recording: a file, bytes, arrays, or a table of another program."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Protocol, TypeAlias, runtime_checkable

import numpy as np
import numpy.typing as npt

from . import _native
from ._report import Report, Rows
from ._samples import mask_of, readable


@runtime_checkable
class ArrowTable(Protocol):
    """A table of pyarrow, pandas, polars, DuckDB, or of another program with Arrow's C data interface."""

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object: ...


Source: TypeAlias = (
    str | os.PathLike[str] | bytes | bytearray | memoryview | npt.NDArray[Any] | Mapping[str, npt.ArrayLike] | ArrowTable
)

_TIME_UNITS = {"s", "ms", "us", "ns"}


def analyze(
    source: Source,
    *,
    rate: float | None = None,
    columns: Mapping[str, str] | Sequence[str] | None = None,
    units: str | Sequence[str] | None = None,
    topic: str | None = None,
    sensor: str | None = None,
    quick: bool = False,
    threads: int = 1,
) -> Report:
    """The report of a recording of an inertial sensor.

    Args:
        source: the path of a file of any format that the command reads, or the bytes of one; a NumPy array with a row a sample;
            a mapping of arrays by name, each of one column or of several; or a table with `__arrow_c_stream__`. Arrays and tables
            are read where they are, without a copy: other threads must not write to them meanwhile. NaN, a null, or the mask of
            a masked array marks a missing number.
        rate: samples per second; overrides the time stamps.
        columns: which column is which channel, as in `{"gyro_x": "wx", "time": "t"}`; by default by their names. The columns of
            an array without names are `0`, `1` …, those of the matrix `gyro` are `gyro.0` …
        units: of the quantities that do not say theirs, as in `"rad/s, m/s^2, ns"`.
        topic: topic, message or array of a file with several sensors.
        sensor: name of a sensor with a data sheet, or its profile file.
        quick: whether curves and models alone are wanted.
        threads: threads that compute, one of which is that of the caller.

    Raises:
        RecordingError: the recording cannot be read, or does not say all that is needed; the message says what it lacks.
        OSError: the file cannot be opened.

    The global interpreter lock is released, and Ctrl-C ends the analysis.
    """
    name, native = _native_source(source)
    report = _native.analyze(
        native,
        name,
        None if rate is None else float(rate),
        [f"{channel}={column}" for channel, column in columns.items()] if isinstance(columns, Mapping) else list(columns or []),
        [unit.strip() for unit in units.split(",")] if isinstance(units, str) else list(units or []),
        topic,
        sensor,
        bool(quick),
        threads,
    )
    return Report(report)


def rows(sources: Iterable[Source], **options: Any) -> Rows:
    """The rows of the reports of many recordings, one after the other; a recording that has no report is one row with the reason.

    `options` are those of `analyze`. An engine of a cluster maps it over its partitions.
    """
    return Rows(_native.Rows.joined([_rows(source, options) for source in sources]))


def _rows(source: Source, options: Mapping[str, Any]) -> _native.Rows:
    try:
        return analyze(source, **options).rows()._native
    except (OSError, _native.RecordingError) as error:
        name = os.fspath(source) if isinstance(source, (str, os.PathLike)) else type(source).__name__
        return _native.Rows.of_failure(name, str(error))


def _native_source(source: Source) -> tuple[str, _native.Arrays | bytes | str]:
    """How the recording is called, and what the compiled half reads."""
    if isinstance(source, (str, os.PathLike)):
        path = os.fspath(source)
        return path, path
    if isinstance(source, (bytes, bytearray, memoryview)):
        return "bytes", bytes(source)
    if isinstance(source, np.ndarray):
        if source.dtype.names:
            return "array", _arrays({name: source[name] for name in source.dtype.names})
        return "array", _arrays({"": source})
    if isinstance(source, Mapping):
        return "arrays", _arrays(source)
    if isinstance(source, ArrowTable):
        return type(source).__name__, _native.Arrays.of_stream(source.__arrow_c_stream__())
    raise TypeError(f"{type(source).__name__} is no path, bytes, array, mapping of arrays or table with __arrow_c_stream__")


def _arrays(arrays: Mapping[str, npt.ArrayLike]) -> _native.Arrays:
    return _native.Arrays.of_numpy([_array(name, array) for name, array in arrays.items()])


def _array(name: str, values: npt.ArrayLike) -> tuple[str, list[tuple[npt.NDArray[Any], npt.NDArray[np.bool_] | None]], str | None]:
    """An array as its columns, each with its mask, and the unit that its type says."""
    mask, array, unit = mask_of(np.ravel(values) if np.ma.isMaskedArray(values) else values), np.asarray(values), None
    if array.dtype.kind in "mM":
        array, unit = _time(array)
    elif array.dtype == object:
        array = array.astype(np.float64)
    elif array.dtype.kind == "b":
        array = array.view(np.uint8)
    if array.dtype.kind not in "biuf":
        raise TypeError(f"the array {name!r} has the dtype {array.dtype}: it must hold numbers")
    if array.ndim not in (1, 2) or array.size == 0:
        raise ValueError(f"the array {name!r} has the shape {array.shape}: a recording has one or two dimensions")
    if array.ndim == 1:
        return name, [(readable(array), mask)], unit
    masks = None if mask is None else mask.reshape(array.shape)
    # The longer side is the time.
    if array.shape[0] < array.shape[1]:
        array, masks = array.T, None if masks is None else masks.T
    columns = [
        (readable(array[:, at]), None if masks is None else masks[:, at]) for at in range(array.shape[1])
    ]
    return name, columns, unit


def _time(array: npt.NDArray[Any]) -> tuple[npt.NDArray[Any], str]:
    """Times as integers, and their unit."""
    unit, count = np.datetime_data(array.dtype)
    if unit not in _TIME_UNITS or count != 1:
        kind = array.dtype.kind
        array, unit = array.astype(f"{kind}8[ns]"), "ns"
    missing = np.isnat(array)
    numbers = array.view(np.int64)
    return (np.where(missing, np.nan, numbers) if missing.any() else numbers), unit
