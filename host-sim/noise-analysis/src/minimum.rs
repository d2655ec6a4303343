//! The minimum of a function of one variable, and where one that rises reaches a level.

/// Part of an interval that a step of the golden section leaves: (√5 − 1)/2.
const GOLDEN: f64 = 0.618_033_988_749_894_9;
/// Most steps of a search for a level, how close it comes, and how many times farther a step may lead than the one before.
const MOST_STEPS: usize = 50;
const PRECISION: f64 = 1e-3;
const LONGEST_STEP: f64 = 4.0;

/// The place of the only minimum of `of` in an interval, to within `width`: at the vertex of a parabola through the three best places, and
/// by the golden section where that does not lead on (R. Brent, "Algorithms for minimization without derivatives", 1973, chapter 5).
pub(crate) fn least_within((mut low, mut high): (f64, f64), width: f64, mut of: impl FnMut(f64) -> f64) -> f64 {
    let mut tried = |at: f64| (at, of(at));
    let mut best = tried(high - GOLDEN * (high - low));
    let (mut second, mut third) = (best, best);
    let (mut step, mut step_before) = (0.0_f64, 0.0_f64);
    let least_step = 0.5 * width;
    loop {
        let (here, middle) = (best.0, low.midpoint(high));
        let left = (here - middle).abs() + 0.5 * (high - low);
        // Between bounds that are no numbers nothing is less.
        if left <= width || left.is_nan() {
            return here;
        }
        let vertex = vertex(best, second, third);
        let is_shorter = (vertex - here).abs() < 0.5 * step_before.abs();
        (step_before, step) = if is_shorter && low < vertex && vertex < high {
            (step, vertex - here)
        } else {
            let longer = if here >= middle { low - here } else { high - here };
            (longer, (1.0 - GOLDEN) * longer)
        };
        let is_at_end = here + step - low < width || high - here - step < width;
        step = if is_at_end { least_step.copysign(middle - here) } else { step };
        let next = tried(here + if step.abs() < least_step { least_step.copysign(step) } else { step });
        if next.1 <= best.1 {
            *if next.0 >= here { &mut low } else { &mut high } = here;
            (best, second, third) = (next, best, second);
        } else {
            *if next.0 < here { &mut low } else { &mut high } = next.0;
            if next.1 <= second.1 || second.0 == here {
                (second, third) = (next, second);
            } else if next.1 <= third.1 || third.0 == here || third.0 == second.0 {
                third = next;
            }
        }
    }
}

/// The vertex of the parabola through three points; NaN if two of them are the same.
fn vertex(a: (f64, f64), b: (f64, f64), c: (f64, f64)) -> f64 {
    let (to_b, to_c) = ((a.0 - b.0) * (a.1 - c.1), (a.0 - c.0) * (a.1 - b.1));
    a.0 - 0.5 * ((a.0 - b.0) * to_b - (a.0 - c.0) * to_c) / (to_b - to_c)
}

/// Distance of a parabola's vertex through three values from the middle one, at most 1 spacing; 0 where it has no maximum.
pub(crate) fn summit([left, middle, right]: [f64; 3]) -> f64 {
    let curvature = 2.0 * middle - left - right;
    if curvature > 0.0 { (0.5 * (right - left) / curvature).clamp(-1.0, 1.0) } else { 0.0 }
}

/// How far from 0, at most so `far`, a `deviate` that rises from 0 has the value 1, to a thousandth; `far` where it stays below. The search goes by
/// secants from the distance `first` on, and halves what is left where one leads out of it.
pub(crate) fn reach(first: f64, far: f64, mut deviate: impl FnMut(f64) -> f64) -> f64 {
    let (mut inside, mut outside) = (0.0, None);
    let mut before = (0.0, -1.0);
    let mut distance = first;
    for _ in 0..MOST_STEPS {
        let misfit = deviate(distance) - 1.0;
        if misfit.abs() < PRECISION || (misfit < 0.0 && distance >= far) {
            break;
        }
        if misfit < 0.0 {
            inside = distance
        } else {
            outside = Some(distance)
        }
        let secant = distance - misfit * (distance - before.0) / (misfit - before.1);
        before = (distance, misfit);
        let is_beyond = secant > inside;
        distance = match outside {
            Some(outside) if is_beyond && secant < outside => secant,
            Some(outside) => inside.midpoint(outside),
            None if is_beyond => secant.min(LONGEST_STEP * distance).min(far),
            None => (LONGEST_STEP * distance).min(far),
        };
    }
    distance
}

/// The place of the minimum of `of` near `start`, at most `farthest` from 0, to within `width`: downhill in growing steps, then between the last three of them.
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
    least_within((low, high), width, of)
}

/// The end, towards `outside`, of a condition that `holds` at `inside`, after so many `steps` of bisection; `outside` if it holds there.
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

/// The place at which `of`, from a minimum `at` towards `end`, has risen by `rise`; `end` if it stays below. Near a minimum it is about a parabola, whose
/// root rises straight.
pub(crate) fn risen((at, end): (f64, f64), rise: f64, mut of: impl FnMut(f64) -> f64) -> f64 {
    let least = of(at);
    let far = (end - at).abs();
    let place = |distance: f64| if distance < far { at + distance.copysign(end - at) } else { end };
    place(reach(far, far, |distance| ((of(place(distance)) - least).max(0.0) / rise.max(f64::MIN_POSITIVE)).sqrt()))
}

#[cfg(test)]
mod tests {
    use super::{downhill, end_of, least_within, reach, risen};
    use std::cell::Cell;

    /// Also where the ends are, and with few calls: a parabola needs three, and then one step to either side of its vertex.
    #[test]
    fn parabolas_have_their_minimum_at_the_vertex() {
        for vertex in [-9.9, -3.7, 0.0, 0.2, 5.1] {
            let calls = Cell::new(0);
            let of = |x: f64| {
                calls.set(calls.get() + 1);
                (x - vertex).powi(2) + 1.0
            };
            // Near a minimum of 1 a double tells values apart from 10⁻⁸ on.
            assert!((least_within((-10.0, 10.0), 1e-6, of) - vertex).abs() < 1e-6, "{vertex}");
            assert!(calls.get() <= 12, "{vertex}: {}", calls.get());
            assert!((downhill(of, (0.1, 0.05), 10.0, 1e-5) - vertex).abs() < 1e-5, "{vertex}");
        }
        // No farther than allowed, but for the last step.
        assert!(downhill(|x| -x, (0.0, 0.1), 1.0, 1e-5) < 1.5);
    }

    /// A cusp, a minimum of the fourth order, an end, and one beside values that are no numbers.
    #[test]
    fn other_minima_are_found_too() {
        for (truth, of) in [
            (0.3, (|x| (x - 0.3).abs()) as fn(f64) -> f64),
            (0.3, |x| (x - 0.3).powi(4)),
            (1.0, |x| -x),
            (0.0, |x| x),
            (0.3, |x| if x > 0.6 { f64::NAN } else { (x - 0.3).abs() }),
            (0.3, |x| if x > 0.6 { f64::INFINITY } else { (x - 0.3).powi(2) }),
        ] {
            assert!((least_within((0.0, 1.0), 1e-5, of) - truth).abs() < 2e-3, "{truth}");
        }
    }

    /// Straight, bent to either side, and with a jump; from first distances that are far too small and far too large.
    #[test]
    fn a_level_is_reached() {
        for first in [1e-3, 0.5, 2.0, 9.0] {
            for (truth, deviate) in [
                (2.0, (|x| x / 2.0) as fn(f64) -> f64),
                (2.0, |x| (x / 2.0).powi(4)),
                (2.0, |x| (x / 2.0).powf(0.3)),
                (2.0, |x| if x < 2.0 { 0.1 } else { 5.0 }),
                (10.0, |x| x / 20.0),
            ] {
                let mut calls = 0;
                let found = reach(first, 10.0, |x| {
                    calls += 1;
                    deviate(x)
                });
                assert!((found - truth).abs() < 1e-2, "{first}: {found}, not {truth}");
                assert!(calls <= 50);
            }
        }
        assert!(reach(1.0, f64::INFINITY, |_| 0.0) > 1e20);
    }

    #[test]
    fn a_parabola_has_risen_on_either_side() {
        for end in [-10.0, 10.0] {
            // (x − 1)² = 9 at −2 and 4, to a thousandth of the distance.
            let found = risen((1.0, end), 9.0, |x| (x - 1.0).powi(2) + 5.0);
            assert!((found - 1.0 - 3.0_f64.copysign(end)).abs() < 3e-3, "{found}");
            assert_eq!(risen((1.0, end), 1e3, |x| (x - 1.0).powi(2)), end);
        }
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
