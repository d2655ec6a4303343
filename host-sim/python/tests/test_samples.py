"""What `push` takes: dtypes, strides, scalars, pandas, missing samples and time stamps; and what it refuses."""

from __future__ import annotations

import copy
from typing import Any

import imunoise
import numpy as np
import pandas as pd
import pytest

COUNTS = np.random.default_rng(1).integers(0, 100, 5_000)
EXPECTED = imunoise.curve(COUNTS, 1.0).adev.tolist()


def adev(*pushed: Any, **options: Any) -> list[float]:
    cascade = imunoise.Cascade(**options)
    for samples in pushed:
        cascade.push(samples)
    return [float(value) for value in cascade.curve(1.0).adev]


@pytest.mark.parametrize("dtype", [f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)] + [">i2", ">u4"])
def test_every_integer_dtype_is_exact(dtype: str) -> None:
    assert adev(COUNTS.astype(dtype)) == EXPECTED


@pytest.mark.parametrize("dtype", ["float16", "float32", "float64", ">f8", "longdouble"])
def test_every_float_dtype_with_an_lsb_of_one_is_exact(dtype: str) -> None:
    assert adev(COUNTS.astype(dtype), lsb=1.0) == EXPECTED
    assert adev(COUNTS.astype(dtype), lsb=0.25, origin=17.0) == EXPECTED


@pytest.mark.parametrize("dtype", ["float16", "float32", "float64"])
def test_the_automatic_grid_holds_every_whole_number(dtype: str) -> None:
    # The LSB is a power of two below 1, so that integers are on the grid.
    assert adev(COUNTS.astype(dtype)) == EXPECTED


def test_layout_does_not_matter() -> None:
    table = np.stack([COUNTS, -COUNTS, COUNTS * 7], axis=1)
    assert adev(table[:, 0]) == EXPECTED
    assert adev(COUNTS[::-1][::-1]) == EXPECTED
    assert adev(np.asfortranarray(table)[:, 0]) == EXPECTED
    assert adev(np.repeat(COUNTS, 3)[::3].astype(np.float32), lsb=1.0) == EXPECTED
    assert adev(COUNTS.tolist()) == EXPECTED
    assert adev(COUNTS.astype(np.int32).data) == EXPECTED


def test_pieces_and_scalars_continue_the_record() -> None:
    assert adev(COUNTS[:7], COUNTS[7:3000], *(int(count) for count in COUNTS[3000:3010]), COUNTS[3010:]) == EXPECTED
    assert adev(np.int16(COUNTS[0]), [], COUNTS[1:]) == EXPECTED
    assert adev(*(float(count) for count in COUNTS[:100]), COUNTS[100:], lsb=1) == EXPECTED


def test_pandas_series_are_taken_with_their_missing_values() -> None:
    assert adev(pd.Series(COUNTS)) == EXPECTED
    assert adev(pd.Series(COUNTS, dtype="Int32")) == EXPECTED
    series = pd.Series(COUNTS.astype(float))
    series[100:103] = np.nan
    nullable = pd.Series(COUNTS, dtype="Int32")
    nullable[100:103] = pd.NA
    by_gap = imunoise.Cascade()
    by_gap.push(COUNTS[:100])
    by_gap.gap(3)
    by_gap.push(COUNTS[103:])
    expected = by_gap.curve(1.0).adev.tolist()
    assert expected != EXPECTED
    assert adev(series, lsb=1) == expected
    assert adev(nullable, lsb=1) == expected


def test_nan_is_a_missing_sample() -> None:
    values = COUNTS.astype(float)
    values[[10, 500, 501, 4999]] = np.nan
    cascade = imunoise.Cascade(lsb=1)
    cascade.push(values)
    assert (len(cascade), cascade.missing) == (4_996, 4)
    assert cascade.curve(1.0).n[-1] == 2048  # the record goes on through the gaps


def test_a_masked_sample_is_missing() -> None:
    mask = np.zeros(len(COUNTS), dtype=bool)
    mask[[0, 10, 500, 501, 4999]] = True
    by_gap = imunoise.Cascade()
    for start, end, missing in [(1, 10, 1), (11, 500, 1), (502, 4999, 2), (0, 0, 1)]:
        by_gap.gap(missing)
        by_gap.push(COUNTS[start:end])
    cascade = imunoise.Cascade()
    cascade.push(np.ma.MaskedArray(COUNTS, mask))
    assert (len(cascade), cascade.missing) == (len(COUNTS) - 5, 5)
    assert cascade.curve(1.0).adev.tolist() == by_gap.curve(1.0).adev.tolist()
    floats = np.ma.MaskedArray(COUNTS.astype(float), mask)
    assert adev(floats, lsb=1) == by_gap.curve(1.0).adev.tolist()
    by_time = imunoise.Cascade()
    by_time.push(np.ma.MaskedArray(COUNTS, mask), times=np.arange(len(COUNTS)), rate=1.0)
    assert by_time.missing == 3  # nothing shows what is missing at either end
    with pytest.raises(TypeError, match="masked counts"):
        imunoise.CovariateRegression().push(np.ma.MaskedArray(COUNTS, mask), COUNTS)


@pytest.mark.parametrize("samples", [2**64, 2**64 - 1, 2**48 + 1])
def test_a_gap_that_no_record_has_is_refused(samples: int) -> None:
    cascade = imunoise.Cascade()
    cascade.push(COUNTS)
    with pytest.raises(ValueError, match="a gap of"):
        cascade.gap(samples)
    cascade.gap(2**48)
    cascade.push(COUNTS)
    assert (len(cascade), cascade.missing) == (2 * len(COUNTS), 2**48)


@pytest.mark.parametrize("unit", ["s", "datetime64"])
def test_time_stamps_show_what_is_missing(unit: str) -> None:
    rate = 200.0
    kept = np.delete(np.arange(len(COUNTS)), [50, 700, 701, 702])
    jitter = np.random.default_rng(2).uniform(-0.2, 0.2, len(kept))
    times: Any = 1_700_000_000.0 + (kept + jitter) / rate
    if unit == "datetime64":
        times = pd.to_datetime(times, unit="s")
    by_time, by_gap = imunoise.Cascade(), imunoise.Cascade()
    by_time.push(COUNTS[kept][:699], times=times[:699], rate=rate)  # the gap lies between the two calls
    by_time.push(COUNTS[kept][699:], times=times[699:], rate=rate)
    by_gap.push(COUNTS[:50])
    by_gap.gap(1)
    by_gap.push(COUNTS[51:700])
    by_gap.gap(3)
    by_gap.push(COUNTS[703:])
    assert by_time.missing == 4
    assert by_time.curve(rate).adev.tolist() == by_gap.curve(rate).adev.tolist()


@pytest.mark.parametrize(
    ("samples", "error", "message"),
    [
        ([1, 2**31], OverflowError, r"sample 1 is 2147483648"),
        (np.array([5, -(2**40)]), OverflowError, r"sample 1 is -1099511627776"),
        ([0.0, 1.0, np.inf], ValueError, r"sample 2 is inf"),
        ([0.0, 1.0, 1e9], OverflowError, None),
        ([[1, 2], [3, 4]], ValueError, r"shape \(2, 2\)"),
        (["1", "2"], TypeError, r"dtype <U1"),
        ([True, False], TypeError, r"dtype bool"),
        ([1j], TypeError, r"dtype complex128"),
        ([3.0, 3.0], ValueError, r"pass lsb="),
        (0.5, ValueError, r"pass lsb="),
    ],
)
def test_refused_samples_leave_the_estimator_as_it_was(samples: Any, error: type[Exception], message: str | None) -> None:
    cascade = imunoise.Cascade(lsb=0.001 if message is None else None)
    with pytest.raises(error, match=message or r"sample 2 is 1000000000.*more than 2\*\*31 steps"):
        cascade.push(samples)
    assert len(cascade) == 0
    cascade.push(COUNTS)
    assert len(cascade) == len(COUNTS)


def test_a_late_error_names_the_index_and_adds_nothing() -> None:
    values = np.zeros(3_000_000)
    values[2_500_000] = -np.inf
    cascade = imunoise.Cascade(lsb=1)
    with pytest.raises(ValueError, match="sample 2500000 is -inf"):
        cascade.push(values)
    assert len(cascade) == 0


def test_other_arguments_are_checked() -> None:
    cascade = imunoise.Cascade()
    cascade.push(COUNTS)
    for rate in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="rate is"):
            cascade.curve(rate)
    with pytest.raises(ValueError, match="lsb is 0"):
        cascade.curve(1.0, lsb=0)
    with pytest.raises(ValueError, match="overlap is 3"):
        imunoise.Cascade(3)
    with pytest.raises(ValueError, match="a gap of -1"):
        cascade.gap(-1)
    with pytest.raises(TypeError, match="floats after counts"):
        cascade.push([0.5, 0.7])
    with pytest.raises(ValueError, match="time stamp 2"):
        cascade.push([1, 2, 3], times=[0.0, 1.0, 1.2], rate=1.0)
    with pytest.raises(ValueError, match="2 time stamps for 3 samples"):
        cascade.push([1, 2, 3], times=[0.0, 1.0], rate=1.0)
    with pytest.raises(TypeError, match="rate"):
        cascade.push([1], times=[0.0])
    floats = imunoise.Cascade()
    floats.push([0.5, 0.7])
    with pytest.raises(ValueError, match="values in the unit"):
        floats.curve(1.0, lsb=0.1)
    with pytest.raises(TypeError, match="counts after floats"):
        floats.push([1, 2])
    with pytest.raises(ValueError, match="different overlaps"):
        cascade.merge(imunoise.Cascade(4))
    assert len(cascade) == len(COUNTS)


def test_merged_estimators_are_the_whole_record() -> None:
    first, later = imunoise.Cascade(), imunoise.Cascade()
    first.push(COUNTS[:2_000])
    later.push(COUNTS[2_000:])
    before = copy.deepcopy(first)
    first.merge(later)
    assert len(first) == len(COUNTS)
    assert len(before) == 2_000
    # At n = 1 only the difference across the border is left out.
    differences = np.delete(np.diff(COUNTS), 1_999)
    assert first.curve(1.0).adev[0] == pytest.approx(np.sqrt(np.mean(differences**2) / 2), rel=1e-12)


def test_an_estimator_without_samples_has_no_points() -> None:
    curve = imunoise.Cascade().curve(1.0)
    assert (len(curve), curve.tau.tolist(), str(curve).count("\n")) == (0, [], 0)
