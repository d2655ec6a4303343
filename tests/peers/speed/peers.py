"""Prints the time of allantools.oadev per sample at octave factors, ns, on white noise: the shortest of several runs."""

import time

import allantools
import numpy

SAMPLES = 1_000_000
counts = numpy.random.default_rng(1).normal(0.0, 20.0, SAMPLES).round()


def run():
    start = time.perf_counter_ns()
    allantools.oadev(counts, rate=1.0, data_type="freq", taus="octave")
    return time.perf_counter_ns() - start


print(f"allantools {allantools.__version__} oadev\t{min(run() for _ in range(5)) / SAMPLES:.2f}")
