"""Fit, trace, regression on covariates, pickling, figures."""

from __future__ import annotations

import pickle
from typing import Any

import imunoise
import numpy as np
import pytest
from imunoise import Term

RATE = 100.0
N = 0.02  # unit·√s
WHITE = np.random.default_rng(1).normal(0.0, N * np.sqrt(RATE), 100_000)


def gyro() -> imunoise.Curve:
    """White noise, a random walk of K = 0.005 unit/√s, and a sinusoid of amplitude 0.05 at 0.7 Hz."""
    random = np.random.default_rng(2)
    walk = np.cumsum(random.normal(0.0, 0.005 / np.sqrt(RATE), len(WHITE)))
    time = np.arange(len(WHITE)) / RATE
    return imunoise.curve(WHITE + walk + 0.05 * np.sin(2 * np.pi * 0.7 * time), RATE)


def test_a_fit_finds_the_white_noise_that_was_put_in() -> None:
    curve = imunoise.curve(WHITE, RATE)
    model = imunoise.fit(curve)
    # The scatter of a variance with 2/3·100 000 degrees of freedom, that of n = 1 alone, is √(2/66 667): of N a half of
    # that, 0.27 %. Five standard deviations.
    assert model["angle_random_walk"].value == pytest.approx(N, rel=5 * 0.0027)
    assert model["angle_random_walk"].low < N * (1 + 5 * 0.0027)
    assert model["angle_random_walk"].unit == "unit·√s"
    for name in ("bias_instability", "rate_random_walk"):
        assert model[name].low == 0.0  # not in the data
        assert model[name].high > 0.0
    assert model.adev([4])[0] ** 2 == pytest.approx(
        model["angle_random_walk"].value ** 2 / 0.04
        + 2 * np.log(2) / np.pi * model["bias_instability"].value ** 2
        + model["rate_random_walk"].value ** 2 * 0.04 / 3 * (1 + 1 / 32),
        rel=1e-12,
    )
    assert model.density([1.0])[0] >= model["angle_random_walk"].value ** 2 * 0.999
    deviance, probability = model.goodness(curve)
    assert deviance > 0.0
    assert probability > 1e-4  # a true model is rejected that rarely
    # The rms error of a true model in percent, from the degrees of freedom; 1.6 times that is rarely exceeded.
    compared = curve.edf[curve.n <= curve.samples / 8]
    assert model.discrepancy(curve)[1] < 1.6 * 100 * np.sqrt(np.mean(1 / (2 * compared)))


def test_terms_are_chosen_by_name_or_with_their_shape() -> None:
    curve = gyro()
    fixed = imunoise.fit(curve, ["angle_random_walk", "rate_random_walk", Term("sinusoid", frequency=0.7)])
    # A sinusoid's amplitude is known to about √(2/M)·σ/A = √(2/100 000)·0.2/0.05 = 1.8 % from the samples; the curve has
    # less information, say three times that.
    assert fixed["sinusoid"].value == pytest.approx(0.05, rel=0.2)
    assert fixed["sinusoid"].shape["frequency"][0] == 0.7
    adjusted = imunoise.fit(
        curve, ["angle_random_walk", "rate_random_walk", Term("sinusoid", frequency=0.5)], shapes=True
    )
    assert adjusted["sinusoid"].shape["frequency"][0] == pytest.approx(0.7, rel=0.05)


def test_terms_that_do_not_exist_are_refused() -> None:
    curve = imunoise.curve(WHITE, RATE)
    for name, shape, message in [
        ("white", {}, "there is no term 'white'"),
        ("markov", {}, "markov needs time_constant"),
        ("markov", {"tau": 1.0}, "no shape parameter 'tau'"),
    ]:
        with pytest.raises(ValueError, match=message):
            Term(name, **shape)
    for term, message in [
        (Term("markov", time_constant=-1.0), "time_constant is -1"),
        (Term("sinusoid", frequency=np.nan), "frequency is NaN"),
        (Term("filter_bandwidth", taps=1000), "1000 taps"),
        (Term("low_pass", frequency=2.0, damping=1.0), "damping is 1"),
    ]:
        with pytest.raises(ValueError, match=message):
            imunoise.fit(curve, [term])
    with pytest.raises(ValueError, match="given twice"):
        imunoise.fit(curve, ["rate_ramp", "rate_ramp"])
    with pytest.raises(ValueError, match="0 terms"):
        imunoise.fit(curve, [])
    with pytest.raises(KeyError, match="markov: the model has angle_random_walk"):
        imunoise.fit(curve)["markov"]


def test_a_trace_names_the_sinusoid() -> None:
    found = imunoise.trace(gyro())
    assert found.completed
    assert [added.term.name for added in found.added] == ["sinusoid"]
    assert found.added[0].term.shape["frequency"][0] == pytest.approx(0.7, rel=0.05)
    assert found.added[0].term is found.after.terms[3]
    assert found.before_p < 1e-6 < found.after_p
    assert imunoise.trace(imunoise.curve(WHITE, RATE)).added == ()


def test_lines_from_a_spectrum_are_kept_and_a_trace_can_be_ended() -> None:
    found = imunoise.trace(gyro(), lines=[0.7, 13.0])
    assert [added.term.shape["frequency"][0] for added in found.added] == [0.7]
    calls = []
    ended = imunoise.trace(gyro(), keep_on=lambda: calls.append(1) or len(calls) < 3)  # type: ignore[func-returns-value]
    assert (ended.completed, len(calls)) == (False, 3)
    with pytest.raises(ZeroDivisionError):
        imunoise.trace(gyro(), keep_on=lambda: 1 / 0 > 0)
    with pytest.raises(ValueError, match="a line at -1 Hz"):
        imunoise.trace(gyro(), lines=[-1.0])
    with pytest.raises(ValueError, match="markov is no filter"):
        imunoise.trace(gyro(), filters=[Term("markov", time_constant=1.0)])


def test_noise_behind_a_butterworth_filter_has_its_frequency() -> None:
    # Every eighth value of the bilinear transform of a Butterworth filter with its corner at 1/160 of its rate, where its form is the analog
    # one. 25,000 samples of 5 Hz at 100 Hz give the frequency to better than 1 %.
    corner, every = RATE / 20, 8
    white = np.random.default_rng(3).normal(0.0, 1.0, 25_000 * every)
    tangent = np.tan(np.pi * corner / (RATE * every))
    driven = tangent**2 * (white[2:] + 2 * white[1:-1] + white[:-2]) / (1 + np.sqrt(2) * tangent + tangent**2)
    before = 2 * (1 - tangent**2) / (1 + np.sqrt(2) * tangent + tangent**2)
    earlier = -(1 - np.sqrt(2) * tangent + tangent**2) / (1 + np.sqrt(2) * tangent + tangent**2)
    smooth = [0.0, 0.0]
    for value in driven.tolist():
        smooth.append(value + before * smooth[-1] + earlier * smooth[-2])
    start = Term("low_pass", frequency=1.5 * corner, damping=float(np.sqrt(0.5)))
    found = imunoise.fit(imunoise.curve(np.array(smooth[::every]), RATE), [start], shapes=True)["low_pass"]
    assert found.shape["frequency"][0] == pytest.approx(corner, rel=0.03)


def test_a_filter_of_the_sensor_is_found() -> None:
    taps = 8
    smooth = np.convolve(np.convolve(WHITE, np.ones(taps) / taps), np.ones(taps) / taps, mode="valid")
    filters = [Term("filter_bandwidth", taps=2**k) for k in range(1, 6)]
    found = imunoise.trace(imunoise.curve(smooth, RATE), filters=filters)
    assert found.added[0].term.name == "filter_bandwidth"
    assert found.added[0].term.shape["taps"][0] == taps


@pytest.mark.parametrize("as_counts", [False, True])
def test_regression_finds_the_sensitivity_to_a_temperature(as_counts: bool) -> None:
    random = np.random.default_rng(3)
    temperature = 25.0 + np.cumsum(random.normal(0.0, 0.01, len(WHITE)))
    other = np.cumsum(random.normal(0.0, 0.01, len(WHITE)))
    rate = WHITE + 0.3 * temperature
    regression = imunoise.CovariateRegression(covariates=2)
    channels: list[Any]
    units: dict[str, Any]
    if as_counts:
        channels = [np.rint(values / 0.001).astype(np.int32) for values in (rate, temperature, other)]
        units = {"lsb": 0.001, "covariate_lsb": [0.001, 0.001]}
    else:
        rate[1234] = np.nan
        channels, units = [rate, temperature, other], {}
    for piece in range(0, len(rate), 30_000):
        regression.push(*(channel[piece : piece + 30_000] for channel in channels))
    restored = pickle.loads(pickle.dumps(regression))
    found = restored.regress(RATE, **units)
    assert len(restored) == len(rate) - (0 if as_counts else 1)
    [sensitivity] = found.sensitivities
    assert sensitivity.covariate == 0
    # Two and a half times the 95 % interval: five standard deviations.
    assert abs(sensitivity.value - 0.3) < 2.5 * (sensitivity.high - sensitivity.low) / 2
    assert sensitivity.high - sensitivity.low < 0.1
    assert sensitivity.sigmas > 4.5
    # What remains is the white noise: at n = 1024 its deviation is N/√τ, with 95 % bounds of its own.
    at = found.compensated.n.tolist().index(1024)
    assert found.curve.adev[at] > 2 * N / np.sqrt(found.curve.tau[at])
    assert found.compensated.adev[at] == pytest.approx(N / np.sqrt(found.curve.tau[at]), rel=0.5)
    repeated = regression.regress(RATE, **units)
    assert repeated.compensated.adev.tolist() == found.compensated.adev.tolist()


def test_regression_checks_its_arguments() -> None:
    with pytest.raises(ValueError, match="7 covariates"):
        imunoise.CovariateRegression(7)
    regression = imunoise.CovariateRegression()
    with pytest.raises(TypeError, match="2 covariates where there should be 1"):
        regression.push([1], [2], [3])
    with pytest.raises(ValueError, match="different lengths: 2, 1"):
        regression.push([1, 2], [2])
    regression.push([1, 2], [2, 4])
    with pytest.raises(TypeError, match="channel 1: counts and floats"):
        regression.push([1, 2], [0.5, 0.75])
    regression.gap(3)
    assert len(regression) == 2
    with pytest.raises(ValueError, match="2 units per count for 1 covariates"):
        regression.regress(1.0, covariate_lsb=[1.0, 2.0])


def test_pickled_objects_are_the_same() -> None:
    cascade = imunoise.Cascade(overlap=4)
    cascade.push(WHITE[:5000])
    cascade.gap(2)
    copy: imunoise.Cascade = pickle.loads(pickle.dumps(cascade))
    for estimator in (cascade, copy):
        estimator.push(WHITE[5000:])
    curve = cascade.curve(RATE)
    assert copy.curve(RATE).adev.tolist() == curve.adev.tolist()
    assert repr(copy) == repr(cascade)
    restored: imunoise.Curve = pickle.loads(pickle.dumps(curve))
    assert str(restored) == str(curve)
    assert restored.edf.tolist() == curve.edf.tolist()
    model = imunoise.fit(restored, ["angle_random_walk", Term("markov", time_constant=2.0)])
    again: imunoise.Model = pickle.loads(pickle.dumps(model))
    assert again.terms == model.terms
    found = imunoise.trace(curve)
    assert pickle.loads(pickle.dumps(found)).after.terms == found.after.terms


def test_a_damaged_state_is_refused() -> None:
    state = list(imunoise.Cascade().__getstate__())
    damaged = bytearray(state[1])
    damaged[40] ^= 1
    cascade = imunoise.Cascade()
    with pytest.raises(ValueError, match="not the state of an estimator"):
        cascade.__setstate__((state[0], bytes(damaged), *state[2:]))


def test_a_range_of_averaging_times() -> None:
    part = gyro().between(0.1, 10.0)
    assert part.tau[0] >= 0.1
    assert part.tau[-1] <= 10.0
    assert len(part) == 6  # 0.16, 0.32 … 5.12 s
    assert len(imunoise.fit(part, ["angle_random_walk"]).terms) == 1


def test_arrays_cannot_be_written() -> None:
    with pytest.raises(ValueError, match="read-only"):
        gyro().adev[0] = 1.0


def test_a_figure_shows_the_curve_and_the_models() -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    curve = gyro()
    axes = curve.plot(imunoise.fit(curve))
    assert axes.get_xscale() == axes.get_yscale() == "log"
    labels = sorted(axes.get_legend_handles_labels()[1])
    assert labels[1] == "measured"
    assert labels[0].startswith("angle random walk")
    assert any(np.array_equal(np.asarray(line.get_ydata()), imunoise.fit(curve).adev(curve.n)) for line in axes.lines)
    assert curve.plot(ax=axes) is axes
