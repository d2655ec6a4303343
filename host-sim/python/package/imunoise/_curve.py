"""A measured Allan deviation curve."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from . import _native

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ._model import Model

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


def _read_only(values: Any, dtype: Any) -> npt.NDArray[Any]:
    array = np.array(values, dtype=dtype)
    array.flags.writeable = False
    return array


class Curve:
    """Allan deviation by averaging time. All arrays have one entry per octave and are read-only.

    Attributes:
        n: averaging factor, samples.
        tau: averaging time, s.
        adev: Allan deviation, in the unit of the samples.
        low, high: 95 % bounds of `adev`, for the noise type at that averaging time.
        edf: equivalent degrees of freedom of `adev**2`.
        count: number of differences that `adev` is made of.
        overlap: differences per averaging time.
        replaced: share of the samples that was replaced because it was missing.
        kurtosis: excess kurtosis of the differences, 0 for Gaussian noise; NaN where it is not known.
        power_law: `quantization`, `white`, `flicker` or `random_walk`, the noise that dominates.
        rate: samples per second.
        samples: number of samples taken.
    """

    __slots__ = (
        "_native",
        "adev",
        "count",
        "edf",
        "high",
        "kurtosis",
        "low",
        "n",
        "overlap",
        "power_law",
        "rate",
        "replaced",
        "samples",
        "tau",
    )

    def __init__(self, native: _native.Curve) -> None:
        points = native.points()
        columns = [[point[column] for point in points] for column in range(11)]
        self._native = native
        self.n: Integers = _read_only(columns[0], np.int64)
        self.tau: Floats = _read_only(columns[1], np.float64)
        self.adev: Floats = _read_only(np.sqrt(_read_only(columns[2], np.float64)), np.float64)
        self.low: Floats = _read_only(np.sqrt(_read_only(columns[3], np.float64)), np.float64)
        self.high: Floats = _read_only(np.sqrt(_read_only(columns[4], np.float64)), np.float64)
        self.edf: Floats = _read_only(columns[5], np.float64)
        self.count: Integers = _read_only(columns[6], np.int64)
        self.overlap: Integers = _read_only(columns[7], np.int64)
        self.replaced: Floats = _read_only(columns[8], np.float64)
        self.kurtosis: Floats = _read_only(columns[9], np.float64)
        self.power_law: tuple[str, ...] = tuple(str(law) for law in columns[10])
        self.samples: int = native.samples()
        self.rate: float = 1.0 / native.sample_period()

    def between(self, shortest: float = 0.0, longest: float = np.inf) -> Curve:
        """The points with these averaging times in s: a fit to them is a fit to that range."""
        return Curve(self._native.between(shortest, longest))

    def plot(self, *models: Model, ax: Axes | None = None, label: str = "measured") -> Axes:
        """Draws the deviation with its 95 % bounds, and each of `models` as a line. Needs matplotlib.

        Returns the axes, which are new if `ax` is None.
        """
        if ax is None:
            import matplotlib.pyplot

            ax = matplotlib.pyplot.subplots()[1]
        bounds = [self.adev - self.low, self.high - self.adev]
        ax.errorbar(self.tau, self.adev, yerr=bounds, fmt="o", markersize=4, capsize=2, label=label)
        for model in models:
            names = ", ".join(term.name.replace("_", " ") for term in model.terms if term.value > 0)
            ax.plot(self.tau, model.adev(self.n), label=names)
        ax.set_xscale("log")
        ax.set_yscale("log")
        ax.set_xlabel("averaging time τ in s")
        ax.set_ylabel("Allan deviation σ(τ)")
        ax.grid(visible=True, which="both", alpha=0.3)
        ax.legend()
        return ax

    def __len__(self) -> int:
        """Number of averaging times."""
        return len(self.n)

    def __repr__(self) -> str:
        return f"<Curve: {len(self)} averaging times, {self.samples} samples at {self.rate:g} Hz>"

    def __str__(self) -> str:
        """A table of the curve."""
        lines = [f"{'tau / s':>10} {'adev':>11} {'low':>11} {'high':>11} {'edf':>10}  power law"]
        rows = zip(self.tau, self.adev, self.low, self.high, self.edf, self.power_law, strict=True)
        for tau, adev, low, high, edf, law in rows:
            lines.append(f"{tau:10.4g} {adev:11.4e} {low:11.4e} {high:11.4e} {edf:10.1f}  {law}")
        return "\n".join(lines)

    def __reduce__(self) -> tuple[Any, ...]:
        return (_restored, (self._native.state(),))


def _restored(state: bytes) -> Curve:
    return Curve(_native.Curve.from_state(state))
