"""Streaming Allan variance with confidence bounds, fitted noise models and a search for missing terms.

>>> import allan_core
>>> c = allan_core.Cascade()
>>> c.push([892, 809, 823, 798, 671, 644, 883, 903, 677])
>>> curve = c.curve(rate=1.0)
>>> [round(float(deviation), 5) for deviation in curve.adev[:2]]
[91.22945, 85.95287]

Samples are those of a rate (or frequency), not of an angle (or phase). `curve` computes a curve in one call; `Cascade` takes
samples as they come; `fit` fits a noise model to a curve, `trace` finds the terms that such a model lacks, and
`CovariateRegression` measures how a channel depends on others, such as the temperature.
"""

from ._cascade import Cascade, curve
from ._curve import Curve
from ._model import FittedTerm, Model, Term, fit
from ._regression import CovariateRegression, Regression, Sensitivity
from ._trace import AddedTerm, Trace, trace

__all__ = [
    "AddedTerm",
    "Cascade",
    "CovariateRegression",
    "Curve",
    "FittedTerm",
    "Model",
    "Regression",
    "Sensitivity",
    "Term",
    "Trace",
    "curve",
    "fit",
    "trace",
]
