//! Against values that others published for the NBS14 1000-point set (NIST SP 1065, and its octave and
//! partial-overlap values computed with independent programs).

use allan_core::Cascade;

const MODULUS: i64 = 2_147_483_647;

/// The set's own integers: the published values are for these divided by the modulus.
fn nbs14() -> impl Iterator<Item = i32> {
    std::iter::successors(Some(1_234_567_890_i64), |n| Some(16_807 * n % MODULUS)).take(1_000).map(|n| n as i32)
}

fn assert_adev<const OVERLAP: usize>(expected: &[(u64, f64)], windows: &[(u64, u64)], digits: f64) {
    let mut cascade = Cascade::<10, OVERLAP>::new();
    nbs14().for_each(|sample| cascade.push(sample));
    let curve = cascade.curve(1.0).scaled(1.0 / MODULUS as f64);
    for &(n, adev) in expected {
        let point = curve.points().iter().find(|point| point.n == n).expect("every octave up to 256");
        assert!((point.avar.sqrt() - adev).abs() <= digits, "P = {OVERLAP}, n = {n}: {}", point.avar.sqrt());
    }
    for &(n, count) in windows {
        assert_eq!(curve.points().iter().find(|point| point.n == n).expect("octave").count, count);
    }
}

#[test]
fn non_overlapping_octaves() {
    let expected = [
        (1, 2.922_318_781e-1),
        (2, 2.051_016_156e-1),
        (4, 1.494_271_424e-1),
        (8, 1.101_348_033e-1),
        (16, 6.238_133_981e-2),
        (32, 5.623_294_473e-2),
        (64, 3.254_990_544e-2),
        (128, 3.385_519_512e-2),
        (256, 1.079_927_226e-2),
    ];
    assert_adev::<1>(&expected, &[], 5e-11);
}

#[test]
fn fully_overlapping_up_to_the_overlap() {
    let expected = [
        (1, 2.922_318_781e-1),
        (2, 2.010_160_422e-1),
        (4, 1.447_913_072e-1),
        (8, 1.057_038_501e-1),
        (16, 6.191_477_842e-2),
    ];
    assert_adev::<16>(&expected, &[], 5e-11);
    assert_adev::<8>(&expected[..4], &[], 5e-11);
}

#[test]
fn partial_overlap() {
    assert_adev::<4>(
        &[
            (8, 1.043_766_441e-1),
            (16, 6.318_483_727e-2),
            (32, 4.876_785_674e-2),
            (64, 3.836_685_149e-2),
            (128, 3.105_885_750e-2),
        ],
        &[(8, 493), (16, 243), (32, 118), (64, 55), (128, 24)],
        5e-11,
    );
    assert_adev::<8>(
        &[(16, 6.166_307_060e-2), (32, 4.793_906_114e-2), (64, 3.718_615_571e-2), (128, 2.925_541_291e-2)],
        &[(16, 485), (32, 235), (64, 110), (128, 47)],
        5e-11,
    );
    assert_adev::<16>(
        &[(32, 4.752_266_711e-2), (64, 3.688_913_691e-2), (128, 2.850_658_259e-2)],
        &[(32, 469), (64, 219), (128, 94)],
        5e-11,
    );
}
