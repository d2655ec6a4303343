"""Runs the peers that are Python packages (requirements.txt) for the program in src/.

Reads from standard input, for each batch, a line `series samples terms` and then the series as little-endian doubles at
100 Hz; answers with one line of JSON.
"""

import contextlib
import io
import json
import sys

import numpy as np
from allan_variance import compute_avar, estimate_parameters
from allan_variance_analyzer.analysis import compute_rate_random_walk, compute_white_noise_params
from allan_variance_analyzer.statistics import compute_allan_variances

RATE_HZ = 100.0
NAMES = ["white", "flicker", "walk"]


def nmayorov(batch, effects):
    """The method of allan-variance: a non-negative least-squares fit of the relative error of the overlapping curve."""
    tau, avar = compute_avar(batch, dt=1.0 / RATE_HZ)
    parameters, _ = estimate_parameters(tau, avar, effects=effects)
    return [
        [float(parameters.iloc[row][name]) if name in parameters.columns else None for name in NAMES]
        for row in range(batch.shape[1])
    ]


def ros(batch):
    """The procedure of allan_variance_ros: slopes at 1 s and 3 s; the minimum of the curve for the bias instability."""
    # The times are whole tenths of a second. `arange(0.1, 1000, 0.1)` misses them by rounding, so a bin could lose a sample.
    tenths = np.arange(1, 10_000)
    periods = tenths / 10
    with contextlib.redirect_stderr(io.StringIO()):
        # Half a sample is added, so that truncation to whole samples cannot lose one.
        deviations = np.sqrt(compute_allan_variances(batch, periods + 0.5 / RATE_HZ, RATE_HZ, overlap=0))
    breakpoint_ = int(np.where(periods == 10)[0][0])
    result = []
    for first in range(0, batch.shape[1], 3):
        axes = deviations[:, first : first + 3]
        white, _ = compute_white_noise_params(periods, axes, breakpoint_)
        walk, _ = compute_rate_random_walk(periods, axes)
        result += [[float(n), float(b), float(k)] for n, b, k in zip(white, axes.min(axis=0), walk)]
    return result


def main():
    stdin = sys.stdin.buffer
    for line in stdin:
        series, samples, terms = line.decode().split()
        shape = (int(series), int(samples))
        batch = np.frombuffer(stdin.read(shape[0] * shape[1] * 8), dtype="<f8").reshape(shape).T.copy()
        answers = [
            ("allan_variance_ros, Python port", ros(batch)),
            ("allan-variance, five terms", nmayorov(batch, None)),
            ("allan-variance, true terms", nmayorov(batch, terms.split(","))),
        ]
        print(json.dumps([{"method": m, "coefficients": c} for m, c in answers]), flush=True)


main()
