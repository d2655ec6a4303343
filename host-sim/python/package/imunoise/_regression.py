"""How a channel depends on covariates such as the temperature, at all averaging times at once."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _native
from ._curve import Curve
from ._samples import Grid, as_samples, automatic_grid, check_gap, check_lsb, check_rate, chunks, mask_of


@dataclass(frozen=True)
class Sensitivity:
    """A significant sensitivity.

    Attributes:
        covariate: index of the covariate.
        value: in the channel's unit over the covariate's.
        low, high: 95 % bounds.
        sigmas: significance in standard deviations of a normal distribution.
    """

    covariate: int
    value: float
    low: float
    high: float
    sigmas: float


@dataclass(frozen=True)
class Regression:
    """Attributes:
    curve: the channel as measured.
    sensitivities: the significant ones, in the order of their significance when chosen.
    compensated: the curve that remains if the channel's dependence on the covariates is subtracted.
    """

    curve: Curve
    sensitivities: tuple[Sensitivity, ...]
    compensated: Curve


class CovariateRegression:
    """Regression of a channel on 1 to 6 covariates that are sampled with it.

    It uses the Allan variances and covariances of the channels alone, at every averaging time, in constant memory. Integers
    are counts; the first array of floats of a channel decides about its grid, as in `Cascade`.
    """

    __slots__ = ("_estimators", "_grids", "_is_float", "_lock")

    def __init__(self, covariates: int = 1) -> None:
        self._estimators = _native.CoupledEstimators(covariates)
        self._grids: list[Grid | None] = [None] * (covariates + 1)
        self._is_float: list[bool | None] = [None] * (covariates + 1)
        self._lock = threading.Lock()

    def push(self, channel: npt.ArrayLike, *covariates: npt.ArrayLike) -> None:
        """Adds samples that were taken together; NaN, or the mask of an array of floats, marks one that is missing in its
        channel.

        Either all samples are added or, if an exception is raised, none.
        """
        arrays = [_with_nan(samples) for samples in (channel, *covariates)]
        if len(arrays) != len(self._grids):
            raise TypeError(f"{len(covariates)} covariates where there should be {len(self._grids) - 1}")
        if any(len(array) != len(arrays[0]) for array in arrays):
            raise ValueError(f"arrays of different lengths: {', '.join(str(len(array)) for array in arrays)}")
        if not len(arrays[0]):
            return
        with self._lock:
            self._add(arrays)

    def _add(self, arrays: list[npt.NDArray[Any]]) -> None:
        grids, kinds = list(self._grids), list(self._is_float)
        for index, array in enumerate(arrays):
            is_float = array.dtype.kind == "f"
            if kinds[index] not in (None, is_float):
                raise TypeError(f"channel {index}: counts and floats are mixed")
            if is_float and grids[index] is None:
                grids[index] = automatic_grid(array)
            kinds[index] = is_float
        estimators = self._estimators.copy()
        columns = [chunks(array) for array in arrays]
        for parts in zip(*columns, strict=True):
            data = [(part[0], grid) for part, grid in zip(parts, grids, strict=True)]
            estimators.push(data, parts[0][1])
        self._estimators, self._grids, self._is_float = estimators, grids, kinds

    def gap(self, samples: int) -> None:
        """Says that so many samples of all channels are missing before the next ones."""
        missing = check_gap(samples)
        with self._lock:
            self._estimators.gap(missing)

    def __len__(self) -> int:
        """Samples taken of the channel."""
        return self._estimators.samples()

    def regress(self, rate: float, lsb: float | None = None, covariate_lsb: npt.ArrayLike | None = None) -> Regression:
        """The sensitivities, and what compensation would leave.

        Args:
            rate: samples per second.
            lsb: units per count of the channel; not for floats.
            covariate_lsb: units per count of each covariate, in order; those of floats are ignored.
        """
        count = len(self._grids) - 1
        given = np.ones(count) if covariate_lsb is None else np.atleast_1d(np.asarray(covariate_lsb, dtype=np.float64))
        if len(given) != count:
            raise ValueError(f"{len(given)} units per count for {count} covariates")
        if lsb is not None and self._grids[0] is not None:
            raise ValueError("lsb is the units per count, but the samples were values in the unit")
        wanted = [1.0 if lsb is None else lsb, *(float(each) for each in given)]
        scales = [
            check_lsb(own) if grid is None else grid[1] for own, grid in zip(wanted, self._grids, strict=True)
        ]
        curve, found, compensated = self._estimators.regress(1.0 / check_rate(rate), scales)
        return Regression(Curve(curve), tuple(Sensitivity(*row) for row in found), Curve(compensated))

    def __getstate__(self) -> tuple[Any, ...]:
        with self._lock:
            return (self._estimators.state(), self._grids, self._is_float)

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        estimators, self._grids, self._is_float = state
        self._estimators = _native.CoupledEstimators.from_state(estimators)
        self._lock = threading.Lock()


def _with_nan(samples: npt.ArrayLike) -> npt.NDArray[Any]:
    """The samples, those that are masked as NaN."""
    array, mask = as_samples(samples), mask_of(samples)
    if mask is None:
        return array
    if array.dtype.kind != "f":
        raise TypeError("masked counts: pass floats, in which NaN marks a missing sample")
    return np.where(mask, np.nan, array)
