//! The minimum of a function of one variable, and the end of a condition.

/// Part of an interval that a step of the golden section leaves: (√5 − 1)/2.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Where `of` is least in an interval that has one minimum, after so many `steps` of golden section, one value of `of` each.
pub(crate) fn golden_section((mut low, mut high): (f64, f64), steps: usize, mut of: impl FnMut(f64) -> f64) -> f64 {
    let inner = |low: f64, high: f64| (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
    let (mut left, mut right) = inner(low, high);
    let (mut at_left, mut at_right) = (of(left), of(right));
    for _ in 0..steps {
        if at_left < at_right {
            (high, right, at_right) = (right, left, at_left);
            left = inner(low, high).0;
            at_left = of(left);
        } else {
            (low, left, at_left) = (left, right, at_right);
            right = inner(low, high).1;
            at_right = of(right);
        }
    }
    0.5 * (low + high)
}

/// Where `of` is least near `start`, at most `farthest` from 0, to within `width`: downhill in growing steps, then by golden section.
pub(crate) fn downhill(of: impl Fn(f64) -> f64, (start, step): (f64, f64), farthest: f64, width: f64) -> f64 {
    let mut step = if of(start + step) < of(start - step) { step } else { -step };
    let (mut behind, mut here, mut value) = (start - step, start, of(start));
    for _ in 0..40 {
        let next = of(here + step);
        if next >= value || (here + step).abs() > farthest {
            break;
        }
        (behind, here, value) = (here, here + step, next);
        step *= 1.5;
    }
    let (low, high) = if step > 0.0 { (behind, here + step) } else { (here + step, behind) };
    let steps = ((width / (high - low)).ln() / GOLDEN.ln()).ceil().max(0.0) as usize;
    golden_section((low, high), steps, of)
}

/// Where a condition that `holds` at `inside` ends towards `outside`, after so many `steps` by halves; `outside` if it holds there.
pub(crate) fn end_of((mut inside, mut outside): (f64, f64), steps: usize, mut holds: impl FnMut(f64) -> bool) -> f64 {
    if holds(outside) {
        return outside;
    }
    for _ in 0..steps {
        let middle = 0.5 * (inside + outside);
        *(if holds(middle) { &mut inside } else { &mut outside }) = middle;
    }
    0.5 * (inside + outside)
}

#[cfg(test)]
mod tests {
    use super::{downhill, end_of, golden_section};

    #[test]
    fn parabolas_have_their_minimum_at_the_vertex() {
        for vertex in [-3.7, 0.0, 0.2, 5.1] {
            let of = |x: f64| (x - vertex).powi(2) + 1.0;
            // 0.618⁴⁰ of 20 is 9·10⁻⁸; near a minimum of 1 a double tells values apart from 10⁻⁸ on.
            assert!((golden_section((-10.0, 10.0), 40, of) - vertex).abs() < 1e-6, "{vertex}");
            assert!((downhill(of, (0.1, 0.05), 10.0, 1e-5) - vertex).abs() < 1e-5, "{vertex}");
        }
        // No farther than allowed, but for the last step.
        assert!(downhill(|x| -x, (0.0, 0.1), 1.0, 1e-5) < 1.5);
    }

    #[test]
    fn conditions_end_at_their_limit_or_not_at_all() {
        for (inside, outside) in [(0.0, 10.0), (0.0, -10.0)] {
            // 2⁻³⁰ of 10 is 9·10⁻⁹.
            let end = end_of((inside, outside), 30, |x| x.abs() < 3.7);
            assert!((end.abs() - 3.7).abs() < 1e-8 && end * outside > 0.0, "{end}");
            assert_eq!(end_of((inside, outside), 30, |_| true), outside);
        }
    }
}
