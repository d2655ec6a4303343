"""Nanoseconds per sample of allan_core and of allantools.oadev, on this machine; the least of several runs."""

from __future__ import annotations

import time
from collections.abc import Callable

import allan_core
import allantools
import numpy as np

SAMPLES = 1 << 20


def nanoseconds(work: Callable[[], object]) -> float:
    def run() -> float:
        start = time.perf_counter_ns()
        work()
        return (time.perf_counter_ns() - start) / SAMPLES

    return min(run() for _ in range(5))


counts = np.random.default_rng(1).normal(0.0, 100.0, SAMPLES).round().astype(np.int32)
values = counts * 0.05
peer = nanoseconds(lambda: allantools.oadev(values, rate=1.0, data_type="freq", taus="octave"))
print(f"{'allantools.oadev':24} {peer:8.1f} ns")
for name, samples in (("allan_core, int32", counts), ("allan_core, float64", values)):
    own = nanoseconds(lambda samples=samples: allan_core.curve(samples, 1.0))  # type: ignore[misc]
    print(f"{name:24} {own:8.1f} ns, {peer / own:.0f} times faster")
