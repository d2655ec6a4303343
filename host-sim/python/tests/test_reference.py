"""Published deviations, and those of allantools and of a direct evaluation of the definition."""

from __future__ import annotations

import imunoise
import allantools
import numpy as np
import pytest

# NIST Special Publication 1065 (W. J. Riley, 2008), page 107: the NBS14 frequency data.
NBS14 = [892, 809, 823, 798, 671, 644, 883, 903, 677]
# The same publication, page 108: 1000 frequencies n/2147483647 of a linear congruential generator.
MODULUS = 2_147_483_647


def thousand_points() -> list[int]:
    numbers = [1_234_567_890]
    while len(numbers) < 1000:
        numbers.append(16_807 * numbers[-1] % MODULUS)
    return numbers


def direct(counts: np.ndarray, n: int, overlap: int) -> float:
    """The definition: differences of neighbouring averages over n samples, one every n/overlap samples."""
    sums = np.concatenate(([0], np.cumsum(counts, dtype=np.int64)))
    starts = np.arange(0, len(counts) - 2 * n + 1, max(1, n // overlap))
    differences = (sums[starts + 2 * n] - 2 * sums[starts + n] + sums[starts]) / n
    return float(np.sqrt(np.mean(differences**2) / 2))


def test_nbs14_has_the_published_deviations() -> None:
    overlapping = imunoise.curve(NBS14, 1.0)
    assert overlapping.n.tolist() == [1, 2, 4]
    assert overlapping.adev[:2] == pytest.approx([91.22945, 85.95287], rel=1e-7)
    without_overlap = imunoise.curve(NBS14, 1.0, overlap=1)
    assert without_overlap.adev[:2] == pytest.approx([91.22945, 115.8082], rel=4e-7)  # seven digits are published


@pytest.mark.parametrize("as_floats", [False, True])
def test_the_thousand_points_have_the_published_deviation(as_floats: bool) -> None:
    numbers = np.array(thousand_points())
    assert numbers[1:4].tolist() == [395_529_916, 1_209_410_747, 633_705_974]
    if as_floats:
        curve = imunoise.curve(numbers / MODULUS, 1.0)
    else:
        curve = imunoise.curve(numbers, 1.0, lsb=1 / MODULUS)
    # Counts are exact, and the references have seven to ten digits. Floats are rounded to at most 2⁻¹⁶ of the deviation at
    # n = 1, whose standard deviation over M/n averages is 2⁻¹⁶/√12/√(M/n) of the result: five of these.
    rounding = 5 * 2**-16 / np.sqrt(12 * len(numbers) / curve.n) if as_floats else np.zeros(len(curve))
    # τ = 1 is published for all overlaps.
    assert abs(curve.adev[0] / 2.922319e-1 - 1) < 2e-7 + rounding[0]
    # Octaves up to the overlap of 8, from allantools 2024.6. Beyond it the differences are taken every n/8 samples:
    # evaluated with NumPy from the definition.
    expected = [2.010160422e-1, 1.447913072e-1, 1.057038501e-1]
    expected += [6.166307060e-2, 4.793906114e-2, 3.718615571e-2, 2.925541291e-2]
    assert (abs(curve.adev[1:8] / expected - 1) < 1e-9 + rounding[1:8]).all()
    assert curve.count[4:8].tolist() == [485, 235, 110, 47]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_without_overlap_it_is_allantools_adev(seed: int) -> None:
    counts = np.random.default_rng(seed).integers(-(2**15), 2**15, 20_000)
    curve = imunoise.curve(counts, 1.0, overlap=1)
    # Sums of integers below 2⁵³ are exact in allantools too; its sum of squares is rounded.
    taus, deviations, _, _ = allantools.adev(counts, rate=1.0, data_type="freq", taus=curve.tau)
    assert taus.tolist() == curve.tau[: len(taus)].tolist()
    assert len(taus) >= 12
    assert curve.adev[: len(taus)] == pytest.approx(deviations, rel=1e-12)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_up_to_the_overlap_it_is_allantools_oadev(seed: int) -> None:
    rate, lsb = 200.0, 0.05
    counts = np.random.default_rng(seed).normal(0.0, 300.0, 50_000).round().astype(np.int16)
    curve = imunoise.curve(counts, rate, lsb=lsb, overlap=16)
    _, deviations, _, _ = allantools.oadev(counts * lsb, rate=rate, data_type="freq", taus=curve.tau[:5])
    # allantools integrates in floating point, to phases of 10⁴·2⁻⁵³ accuracy against differences of 10⁻².
    assert curve.adev[:5] == pytest.approx(deviations, rel=1e-9)


@pytest.mark.parametrize("overlap", [1, 2, 4, 8, 16])
def test_every_overlap_is_the_definition(overlap: int) -> None:
    counts = np.cumsum(np.random.default_rng(7).integers(-100, 101, 9_000))
    curve = imunoise.curve(counts, 10.0, overlap=overlap)
    assert curve.n[-1] == 4096
    expected = [direct(counts, int(n), overlap) for n in curve.n]
    assert curve.adev == pytest.approx(expected, rel=1e-12)


def test_an_offset_costs_no_digit() -> None:
    noise = np.random.default_rng(4).integers(-50, 51, 30_000)
    shifted = imunoise.curve(noise + 2_000_000_000, 1.0)
    assert shifted.adev.tolist() == imunoise.curve(noise, 1.0).adev.tolist()


def test_floats_lose_what_rounding_to_the_grid_loses() -> None:
    values = 9.81 + np.random.default_rng(5).normal(0.0, 1e-4, 20_000)
    cascade = imunoise.Cascade(overlap=1)
    cascade.push(values)
    assert cascade.quantizer is not None
    origin, lsb = cascade.quantizer
    assert origin == values[0]
    assert np.log2(lsb) == round(np.log2(lsb))
    assert 2**-17 < lsb / 1e-4 < 2**-15  # the first differences are those of white noise with this deviation
    curve = cascade.curve(rate=100.0)
    _, deviations, _, _ = allantools.adev(values, rate=100.0, data_type="freq", taus=curve.tau[:8])
    # Five standard deviations of the rounding errors, as above; at n = 128 they are 2·10⁻⁶.
    assert (abs(curve.adev[:8] / deviations - 1) < 5 * 2**-16 / np.sqrt(12 * len(values) / curve.n[:8])).all()


def test_single_precision_loses_what_rounding_to_its_coarser_grid_loses() -> None:
    values = np.random.default_rng(7).normal(9.81, 0.01, 100_000).astype(np.float32)
    curve = imunoise.curve(values, 100.0, overlap=1)
    _, deviations, _, numbers = allantools.adev(values.astype(float), rate=100.0, data_type="freq", taus=curve.tau)
    # A step is 1/256 of the deviation or less, and its rounding error, step/√12, is independent of the noise. The variance
    # differs by twice their covariance, which is that of about half as many independent differences; and by the error's own.
    rounding = 1 / 256 / np.sqrt(12)
    allowed = 5 * 2 * rounding / np.sqrt(numbers / 2) + 2 * rounding**2
    assert np.all(np.abs((curve.adev / deviations) ** 2 - 1) < allowed)
    assert not np.allclose(curve.adev, deviations, rtol=1e-9)  # the grid is the coarse one


def test_white_noise_has_its_textbook_degrees_of_freedom() -> None:
    counts = np.random.default_rng(6).normal(0.0, 100.0, 1 << 17).round()
    curve = imunoise.curve(counts.astype(np.int32), 1.0)
    # Greenhall and Riley (2003), exact for white noise, 2¹⁷ samples and 8 differences per averaging time.
    assert curve.power_law[10] == "white"
    assert curve.edf[10] == pytest.approx(0.982 * 189.75, rel=5e-3)
    assert curve.low[10] < curve.adev[10] < curve.high[10]
