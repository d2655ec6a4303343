"""The search for the terms that the baseline model lacks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from . import _native
from ._curve import Curve
from ._model import FittedTerm, Model, Term


@dataclass(frozen=True)
class AddedTerm:
    """A term that the baseline model lacked.

    Attributes:
        term: the term, as fitted in the final model.
        score: decrease of the deviance when it was added, in units of its scatter: a squared significance.
        residual_tau: averaging time in s of the largest residual before it was added.
        residual_excess: that residual, `σ/σ_model − 1`.
        residual_sigmas: that residual in standard deviations.
    """

    term: FittedTerm
    score: float
    residual_tau: float
    residual_excess: float
    residual_sigmas: float


@dataclass(frozen=True)
class Trace:
    """The baseline model (N, B, K), and the model with the terms that were missing.

    Attributes:
        before, after: the two models.
        before_p, after_p: probability of a deviance at least as large if that model is true.
        added: the added terms, in the order in which they were found; empty if nothing is missing.
        completed: False if `keep_on` ended the search.
    """

    before: Model
    before_p: float
    after: Model
    after_p: float
    added: tuple[AddedTerm, ...]
    completed: bool


def trace(
    curve: Curve,
    *,
    lines: Sequence[float] | None = None,
    filters: Sequence[Term] = (),
    keep_on: Callable[[], bool] | None = None,
) -> Trace:
    """Fits N, B and K to `curve` and adds the missing terms, the most significant first.

    The candidates are quantization, a rate ramp, Markov processes, sinusoids, resonances and filters.

    Args:
        curve: the curve.
        lines: frequencies in Hz of lines in a spectrum of the samples; by default only those that the curve shows.
        filters: `filter_bandwidth` terms that the sensor may have.
        keep_on: called between the fits; if it returns False, the search ends with what was found. Ctrl-C ends it with
            `KeyboardInterrupt`.
    """
    shapes = []
    for term in filters:
        if term.name != "filter_bandwidth":
            raise ValueError(f"{term.name} is no filter: filters are terms with the name filter_bandwidth")
        shapes.append((term.shape["stages"], term.shape["taps"], term.shape["decimation"]))
    frequencies = None if lines is None else [float(line) for line in lines]
    (before, _, before_p), (after, _, after_p), added, completed = _native.trace(
        curve._native, frequencies, shapes, keep_on
    )
    model = Model(after)
    found = tuple(
        AddedTerm(model.terms[term], score, n / curve.rate, excess, sigmas) for term, score, n, excess, sigmas in added
    )
    return Trace(Model(before), before_p, model, after_p, found, completed)
