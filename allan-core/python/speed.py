"""Processor time per sample of allan_core and of allantools.oadev on the same arrays, on this machine; medians of runs in turn."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Any

import allan_core
import allantools
import numpy as np
import pandas as pd

SAMPLES = 1 << 20
RUNS = 7


def nanoseconds(work: Callable[[], object]) -> float:
    start = time.process_time_ns()
    work()
    return (time.process_time_ns() - start) / SAMPLES


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
print(f"{'':26} {'allan_core':>10} {'allantools':>11} {'times faster':>12}")
for name, (own, others) in arrays.items():
    pairs = [
        (
            nanoseconds(lambda: allan_core.curve(own, 1.0)),
            nanoseconds(lambda: allantools.oadev(others, rate=1.0, data_type="freq", taus="octave")),
        )
        for _ in range(RUNS)
    ]
    fast, slow = (statistics.median(times) for times in zip(*pairs, strict=True))
    print(f"{name:26} {fast:7.1f} ns {slow:8.1f} ns {slow / fast:12.1f}")
