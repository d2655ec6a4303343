"""Noise models fitted to a curve."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _native
from ._curve import Curve, Floats

# Names of the shape parameters of each term, in the order of the compiled half, with their defaults.
_SHAPES: dict[str, dict[str, float | None]] = {
    "quantization": {},
    "angle_random_walk": {},
    "bias_instability": {},
    "rate_random_walk": {},
    "rate_ramp": {},
    "markov": {"time_constant": None},
    "resonance": {"frequency": None, "bandwidth": None},
    "sinusoid": {"frequency": None},
    "low_pass": {"frequency": None, "damping": None},
    "filter_bandwidth": {"stages": 2.0, "taps": None, "decimation": 1.0},
}

BASELINE = ("angle_random_walk", "bias_instability", "rate_random_walk")


@dataclass(frozen=True)
class Term:
    """A term of a noise model, with its shape parameters if it has any.

    ========================  ==================================================  =============
    name                      Allan variance or meaning                           coefficient
    ========================  ==================================================  =============
    ``quantization``          Q: 3Q²/τ²                                           unit·s
    ``angle_random_walk``     N: N²/τ                                             unit·√s
    ``bias_instability``      B: (2 ln 2/π)·B²                                    unit
    ``rate_random_walk``      K: K²τ/3 (exact for samples)                        unit/√s
    ``rate_ramp``             R: R²τ²/2                                           unit/s
    ``markov``                exponentially correlated; ``time_constant`` in s    unit
    ``resonance``             ``frequency`` and ``bandwidth`` in Hz               unit
    ``sinusoid``              ``frequency`` in Hz; the coefficient its amplitude  unit
    ``low_pass``              N after a low-pass filter of the second order: its  unit·√s
                              natural ``frequency`` in Hz, ``damping`` below 1
    ``filter_bandwidth``      N after ``stages`` (2) moving averages of ``taps``  unit·√s
                              values, each ``decimation``-th (1) of them read
    ========================  ==================================================  =============
    """

    name: str
    shape: dict[str, float] = field(default_factory=dict)

    def __init__(self, name: str, **shape: float) -> None:
        known = _SHAPES.get(name)
        if known is None:
            raise ValueError(f"there is no term {name!r}; there are {', '.join(_SHAPES)}")
        for parameter in shape:
            if parameter not in known:
                raise ValueError(f"{name} has no shape parameter {parameter!r}; it has {', '.join(known) or 'none'}")
        complete = {parameter: shape.get(parameter, default) for parameter, default in known.items()}
        lacking = [parameter for parameter, value in complete.items() if value is None]
        if lacking:
            raise ValueError(f"{name} needs {', '.join(lacking)}")
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "shape", {key: float(value) for key, value in complete.items() if value is not None})


@dataclass(frozen=True)
class FittedTerm:
    """A fitted coefficient with its 95 % bounds.

    Attributes:
        name: the term, as in `Term`.
        coefficient: what `value` is: `value`, `slope`, `deviation` or `amplitude`.
        value: estimate; 0 if the data does not show the term.
        low, high: 95 % bounds; `high` limits a term that the data does not show.
        unit: unit of the coefficient in terms of the unit of the samples.
        shape: shape parameters by name, each with its value and 95 % bounds.
    """

    name: str
    coefficient: str
    value: float
    low: float
    high: float
    unit: str
    shape: dict[str, tuple[float, float, float]]


class Model:
    """A sum of noise terms, fitted to a curve. `model["bias_instability"]` is a term by its name."""

    __slots__ = ("_native", "terms")

    def __init__(self, native: _native.Model) -> None:
        self._native = native
        self.terms: tuple[FittedTerm, ...] = tuple(
            FittedTerm(name, coefficient, *interval, unit, dict(shape))
            for name, coefficient, interval, unit, shape in native.terms()
        )

    def __getitem__(self, name: str) -> FittedTerm:
        for term in self.terms:
            if term.name == name:
                return term
        raise KeyError(f"{name}: the model has {', '.join(term.name for term in self.terms)}")

    def adev(self, n: npt.ArrayLike) -> Floats:
        """Modelled Allan deviation at averaging factors in samples, such as those of `Curve.n`."""
        factors = np.atleast_1d(np.asarray(n))
        if factors.dtype.kind not in "iu" or (factors < 1).any():
            raise ValueError("averaging factors must be whole numbers of samples, 1 or more")
        return np.sqrt(np.array(self._native.avar([int(factor) for factor in factors]), dtype=np.float64))

    def density(self, frequency: npt.ArrayLike) -> Floats:
        """Modelled two-sided power spectral density at frequencies in Hz, in unit²/Hz."""
        frequencies = np.atleast_1d(np.asarray(frequency, dtype=np.float64))
        return np.array(self._native.density([float(each) for each in frequencies]), dtype=np.float64)

    def goodness(self, curve: Curve) -> tuple[float, float]:
        """Deviance of the model on the curve to which it was fitted, and the probability of a larger one if it is true."""
        return self._native.goodness(curve._native)

    def discrepancy(self, curve: Curve) -> tuple[float, float]:
        """Deviance per point (1 for a true model on its own data) and rms error of the Allan deviation in percent.

        For any curve in the same unit at the same rate, over averaging times up to an eighth of its length.
        """
        found = self._native.discrepancy(curve._native)
        if found is None:
            raise ValueError("the curve has no averaging time up to an eighth of its length")
        return found[0], found[1]

    def __repr__(self) -> str:
        return f"<Model: {', '.join(f'{term.name} {term.value:.4g}' for term in self.terms)}>"

    def __str__(self) -> str:
        """A table of the terms."""
        lines = [f"{'term':<18} {'value':>11} {'low':>11} {'high':>11}  unit"]
        for term in self.terms:
            lines.append(f"{term.name:<18} {term.value:11.4e} {term.low:11.4e} {term.high:11.4e}  {term.unit}")
            for name, (value, low, high) in term.shape.items():
                lines.append(f"  {name:<16} {value:11.4e} {low:11.4e} {high:11.4e}")
        return "\n".join(lines)

    def __reduce__(self) -> tuple[Any, ...]:
        return (_restored, (self._native.state(),))


def _restored(state: bytes) -> Model:
    return Model(_native.Model.from_state(state))


def fit(curve: Curve, terms: Iterable[str | Term] = BASELINE, *, shapes: bool = False) -> Model:
    """Fits the coefficients of `terms` to all points of `curve`, by maximum likelihood, with 95 % bounds.

    Args:
        curve: the curve; `Curve.between` selects a range of it.
        terms: names, or a `Term` where the term has a shape. At most 8, each once.
        shapes: whether to adjust the shape parameters too, starting from those given.
    """
    named = [term if isinstance(term, Term) else Term(term) for term in terms]
    return Model(_native.fit(curve._native, [(term.name, list(term.shape.values())) for term in named], shapes))
