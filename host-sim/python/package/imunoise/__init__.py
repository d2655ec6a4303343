"""Noise of inertial sensors: recordings analysed, and the streaming estimator by itself.

`analyze` makes the report of a recording: of a file, of bytes, of arrays, or of a table of pandas, polars, pyarrow or DuckDB.

>>> import imunoise
>>> c = imunoise.Cascade()
>>> c.push([892, 809, 823, 798, 671, 644, 883, 903, 677])
>>> curve = c.curve(rate=1.0)
>>> [round(float(deviation), 5) for deviation in curve.adev[:2]]
[91.22945, 85.95287]

Samples are those of a rate (or frequency), not of an angle (or phase). `curve` computes a curve in one call; `Cascade` takes
samples as they come; `fit` fits a noise model to a curve, `trace` finds the terms that such a model lacks, and
`CovariateRegression` measures how a channel depends on others, such as the temperature.
"""

from ._analyze import ArrowTable, Source, analyze, rows
from ._cascade import Cascade, curve
from ._curve import Curve
from ._model import FittedTerm, Model, Term, fit
from ._native import RecordingError
from ._regression import CovariateRegression, Regression, Sensitivity
from ._report import Channel, Estimate, Finding, Report, Rows, Svg
from ._trace import AddedTerm, Trace, trace

__all__ = [
    "AddedTerm",
    "ArrowTable",
    "Cascade",
    "Channel",
    "CovariateRegression",
    "Curve",
    "Estimate",
    "Finding",
    "FittedTerm",
    "Model",
    "RecordingError",
    "Regression",
    "Report",
    "Rows",
    "Sensitivity",
    "Source",
    "Svg",
    "Term",
    "Trace",
    "analyze",
    "curve",
    "fit",
    "rows",
    "trace",
]
