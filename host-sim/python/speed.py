"""Processor time on this machine, medians of runs in turn: the estimator beside other programs on the same arrays, and the analysis of an
array beside the command on the same numbers in a file.

    python speed.py [COMMAND]     # COMMAND, such as target/release/imunoise: the time of `analyze` too

The other programs are those of tests/requirements.txt and tests/peers/accuracy/requirements.txt.
"""

from __future__ import annotations

import contextlib
import io
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import allantools
import avar
import imunoise
import numpy as np
import pandas as pd
from allan_variance_analyzer.statistics import compute_allan_variances

SAMPLES = 1 << 20
ROWS = 1_000_000
RUNS = 7
OCTAVES = 2 ** np.arange(19)  # as many samples as allantools takes octaves of
CHANNELS = [f"{kind}_{axis}" for kind in ("gyro", "accl") for axis in "xyz"]


def seconds(work: Callable[[], object]) -> float:
    """Processor time of a call, of all threads."""
    start = time.process_time_ns()
    work()
    return (time.process_time_ns() - start) / 1e9


def seconds_of_command(*words: str) -> float:
    """Processor time of a command."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(words, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return (after.ru_utime - before.ru_utime) + (after.ru_stime - before.ru_stime)


def medians(*works: Callable[[], float], runs: int = RUNS) -> list[float]:
    """The medians of runs in turn."""
    return [statistics.median(times) for times in zip(*([work() for work in works] for _ in range(runs)), strict=True)]


counts = np.random.default_rng(1).normal(0.0, 100.0, SAMPLES).round()
values = counts * 0.05 + np.random.default_rng(2).normal(0.0, 0.01, SAMPLES)
gaps = values.copy()
gaps[::1000] = np.nan
# The array, and what allantools takes: a series is its values there.
arrays: dict[str, tuple[Any, Any]] = {
    **{dtype: (counts.astype(dtype),) * 2 for dtype in ("int16", "int32", "int64")},
    **{dtype: (values.astype(dtype),) * 2 for dtype in ("float32", "float64")},
    "int32, strided": (np.repeat(counts.astype(np.int32), 3)[::3],) * 2,
    "float64, strided": (np.repeat(values, 3)[::3],) * 2,
    "int64, pandas": (pd.Series(counts.astype(np.int64)), counts.astype(np.int64)),
    "float64, pandas": (pd.Series(values), values),
    "float64, NaN in 1 of 1000": (gaps,) * 2,
}
print(f"{'':26} {'imunoise':>10} {'allantools':>11} {'times faster':>12}")
for name, (own, others) in arrays.items():
    fast, slow = medians(
        lambda: seconds(lambda: imunoise.curve(own, 1.0)),
        lambda: seconds(lambda: allantools.oadev(others, rate=1.0, data_type="freq", taus="octave")),
    )
    print(f"{name:26} {fast / SAMPLES * 1e9:7.1f} ns {slow / SAMPLES * 1e9:8.1f} ns {slow / fast:12.1f}")


def analyzer() -> object:
    """allan-variance-analyzer on six columns, the number that it takes, without overlap."""
    table = np.tile(values[:, None], (1, 6))
    with contextlib.redirect_stderr(io.StringIO()):
        # Half a sample on top, so that truncation to whole samples cannot lose one.
        return compute_allan_variances(table, OCTAVES + 0.5, 1.0, overlap=0)


with contextlib.redirect_stdout(io.StringIO()):
    ours, by_avar, by_analyzer = medians(
        lambda: seconds(lambda: imunoise.curve(values, 1.0)),
        lambda: seconds(lambda: avar.variance(values, OCTAVES)),
        lambda: seconds(analyzer) / 6,
    )
print(f"\n{'a float64 at octaves':26} {'':>10} {'times faster':>12}")
for name, own_time in (("imunoise", ours), ("avar", by_avar), ("allan-variance-analyzer", by_analyzer)):
    print(f"{name:26} {own_time / SAMPLES * 1e9:7.1f} ns {own_time / ours:12.1f}")

if len(sys.argv) > 1:
    random = np.random.default_rng(3)
    table = random.normal(0.0, 2e-3, (ROWS, 6))
    columns = {name: str(at) for at, name in enumerate(CHANNELS)}
    options = {"columns": columns, "units": ["rad/s", "m/s^2"], "rate": 200.0}
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "table.npy"
        np.save(file, table)
        chosen = ",".join(f"{name}={at}" for name, at in columns.items())
        words = [sys.argv[1], "analyze", str(file), "--columns", chosen, "--units", "rad/s,m/s^2", "--rate", "200", "--quiet"]
        own_time, by_command = medians(
            lambda: seconds(lambda: imunoise.analyze(table, threads=os.cpu_count() or 1, **options)),
            lambda: seconds_of_command(*words),
            runs=5,
        )
    print(f"\nanalyze, {ROWS} rows of six channels: the array {own_time:.2f} s, the command {by_command:.2f} s of processor")
