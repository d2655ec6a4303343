"""The global interpreter lock is released, and Ctrl-C is noticed."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator

import imunoise
import numpy as np
import pytest
from imunoise import _native

from recording import UNITS, columns


def is_seen_during(work: Callable[[], object]) -> bool:
    """Whether another thread runs in the middle half of a call of compiled code, which it cannot where the lock is held.

    On a busy machine it runs there in few calls of a millisecond: `work` is repeated for up to a minute.
    """
    stamps: list[float] = []
    stop = threading.Event()

    def watch() -> None:
        while not stop.is_set():
            stamps.append(time.perf_counter())
            time.sleep(1e-4)

    thread = threading.Thread(target=watch)
    thread.start()
    try:
        last = time.perf_counter() + 60.0
        while (start := time.perf_counter()) < last:
            stamps.clear()
            work()
            end = time.perf_counter()
            quarter = (end - start) / 4
            if any(start + quarter < stamp < end - quarter for stamp in stamps):
                return True
        return False
    finally:
        stop.set()
        thread.join()


def test_other_threads_run_during_a_push() -> None:
    estimator = _native.Estimator(8)
    samples = np.zeros(1 << 25, dtype=np.int32)
    assert is_seen_during(lambda: estimator.push(samples, None, 0))


def test_other_threads_run_during_a_fit() -> None:
    curve = imunoise.curve(np.random.default_rng(1).integers(0, 100, 1 << 16), 1.0)
    terms = ["quantization", "angle_random_walk", "bias_instability", "rate_random_walk", "rate_ramp"]
    named = [(name, ()) for name in terms] + [("sinusoid", (0.1,)), ("markov", (9.0,))]
    assert is_seen_during(lambda: _native.fit(curve._native, named, True))


def test_estimators_can_be_used_by_several_threads_at_once() -> None:
    estimator = _native.Estimator(8)
    samples = np.zeros(1 << 16, dtype=np.int32)
    threads = [threading.Thread(target=lambda: estimator.push(samples, None, 0)) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert estimator.samples()[0] == 8 << 16


def test_eight_threads_push_into_one_estimator_and_nothing_is_lost() -> None:
    cascade, regression = imunoise.Cascade(), imunoise.CovariateRegression()
    samples = np.random.default_rng(1).integers(-40, 41, 1_000_000)

    def work() -> None:
        cascade.push(samples)
        regression.push(samples[:1_000], samples[:1_000])
        cascade.gap(1)

    threads = [threading.Thread(target=work) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert (len(cascade), cascade.missing, len(regression)) == (8 * len(samples), 8, 8_000)


def test_other_threads_run_during_an_analysis() -> None:
    table = columns(4_000)
    assert is_seen_during(lambda: imunoise.analyze(table, units=UNITS))


@pytest.fixture
def ctrl_c() -> Iterator[Callable[[], None]]:
    """Sends this process an interrupt, which Python takes even if the process was started with interrupts ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield lambda: os.kill(os.getpid(), signal.SIGINT)
    signal.signal(signal.SIGINT, before)


def test_ctrl_c_ends_a_push_and_nothing_is_added(ctrl_c: Callable[[], None]) -> None:
    cascade = imunoise.Cascade()
    cascade.push([1, 2, 3])
    long = np.broadcast_to(np.int32(5), (1 << 32,))  # no memory, some ten seconds
    main = threading.get_ident()

    def interrupt() -> None:
        while sys._current_frames()[main].f_code.co_name != "_push":
            time.sleep(1e-3)
        ctrl_c()

    thread = threading.Thread(target=interrupt, daemon=True)
    thread.start()
    with pytest.raises(KeyboardInterrupt):
        cascade.push(long)
    thread.join()
    assert len(cascade) == 3


@pytest.mark.parametrize("threads", [1, 2])
def test_ctrl_c_ends_an_analysis(ctrl_c: Callable[[], None], threads: int) -> None:
    table = columns(1_000_000)
    main = threading.get_ident()

    def interrupt() -> None:
        while sys._current_frames()[main].f_code.co_name != "analyze":
            time.sleep(1e-3)
        ctrl_c()

    thread = threading.Thread(target=interrupt, daemon=True)
    thread.start()
    with pytest.raises(KeyboardInterrupt):
        imunoise.analyze(table, units=UNITS, threads=threads)
    thread.join()
    assert imunoise.analyze(columns(2_000), units=UNITS).complete  # another one is not cancelled


def test_ctrl_c_ends_a_trace(ctrl_c: Callable[[], None]) -> None:
    curve = imunoise.curve(np.random.default_rng(1).integers(0, 100, 10_000), 1.0)

    def interrupt() -> bool:
        ctrl_c()
        return True

    with pytest.raises(KeyboardInterrupt):
        imunoise.trace(curve, keep_on=interrupt)
