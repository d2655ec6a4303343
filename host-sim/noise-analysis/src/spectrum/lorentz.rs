//! A resonance in the spectrum: Whittle's likelihood of a Lorentz curve over a level.

use nalgebra::{Matrix4, Vector4};
use std::f64::consts::PI;

/// Half-width of the region that is fitted, in widths of the line; at least [`LEAST`] ordinates.
const REACH: f64 = 6.0;
const LEAST: f64 = 16.0;
/// Groups of neighbouring ordinates in the region, at most.
const GROUPS: usize = 256;
const ROUNDS: usize = 60;
/// Width of a line of the record itself, in resolutions.
const NARROWEST: f64 = 0.5;

/// `level·(1 + height/(1 + (2(k − centre)/width)²))` over the ordinates `k` of a whitened spectrum, and the same at `−centre`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lorentz {
    pub level: f64,
    pub height: f64,
    /// In resolutions, as is the full width at half maximum.
    pub centre: f64,
    pub width: f64,
    /// Standard deviations of `ln height`, of `centre` and of `ln width`.
    pub errors: [f64; 3],
    /// Covariance of `ln height` and `ln width`.
    pub height_and_width: f64,
    /// −2 log-likelihood ratio against a level alone.
    pub statistic: f64,
}

/// The mean of some neighbouring ordinates.
struct Group {
    place: f64,
    density: f64,
    ordinates: f64,
}

impl Lorentz {
    /// The likeliest curve near `centre` with about `width`, both in resolutions; `None` if there is none.
    pub(super) fn fit(whitened: &[f64], lowest: usize, centre: f64, width: f64) -> Option<Self> {
        let near = Self::within(whitened, lowest, centre, width, REACH * width)?;
        // The skirts of a high line stand out far beyond its width.
        let skirts = near.width * near.height.sqrt().max(REACH);
        Self::within(whitened, lowest, near.centre, near.width, skirts.min(whitened.len() as f64 / 8.0)).or(Some(near))
    }

    /// As [`fit`](Self::fit), looking at the ordinates within `reach` of the centre.
    fn within(whitened: &[f64], lowest: usize, centre: f64, width: f64, reach: f64) -> Option<Self> {
        let reach = reach.max(LEAST);
        let low = ((centre - reach).max(lowest as f64)) as usize;
        let high = ((centre + reach) as usize).min(whitened.len().checked_sub(2)?);
        if high < low + LEAST as usize {
            return None;
        }
        let groups = groups(&whitened[low..=high], low);
        let weight: f64 = groups.iter().map(|group| group.ordinates).sum();
        let mean = |groups: &mut dyn Iterator<Item = &Group>| {
            let (sum, weight) = groups.fold((0.0, 0.0), |(sum, weight), group| {
                (sum + group.ordinates * group.density, weight + group.ordinates)
            });
            sum / weight
        };
        let everything = mean(&mut groups.iter());
        let surroundings = mean(&mut groups.iter().filter(|group| (group.place - centre).abs() > 0.6 * reach));
        let summit = mean(&mut around(&groups, centre, width).iter().copied());
        // The mean over a full width is π/4 of the height.
        let height = ((summit / surroundings - 1.0) * 4.0 / PI).max(0.1);
        let mut parameters = Vector4::new(surroundings.ln(), height.ln(), centre, width.ln());
        let mut likelihood = likelihood(&groups, &parameters);
        let mut damping = 1e-2;
        for _ in 0..ROUNDS {
            let (information, score) = normal_equations(&groups, &parameters);
            let damped = information + Matrix4::from_diagonal(&(damping * information.diagonal()));
            let next = parameters + damped.cholesky()?.solve(&score);
            let better = self::likelihood(&groups, &next);
            let inside = (next[2] - centre).abs() < 2.0 * width.max(reach / REACH)
                && next[3] < reach.ln()
                && next[3] > NARROWEST.ln();
            if inside && better > likelihood {
                let gain = better - likelihood;
                (parameters, likelihood, damping) = (next, better, damping / 10.0);
                if gain < 1e-6 {
                    break;
                }
            } else if damping > 1e6 {
                break;
            } else {
                damping *= 10.0;
            }
        }
        let level_alone = -weight * (everything.ln() + 1.0);
        let covariance = normal_equations(&groups, &parameters).0.cholesky()?.inverse();
        Some(Self {
            level: parameters[0].exp(),
            height: parameters[1].exp(),
            centre: parameters[2],
            width: parameters[3].exp(),
            errors: [1, 2, 3].map(|at| covariance[(at, at)].sqrt()),
            height_and_width: covariance[(1, 3)],
            statistic: 2.0 * (likelihood - level_alone),
        })
    }

    /// What an ordinate must be multiplied with to leave the level alone.
    pub(super) fn deflation(&self, place: f64) -> f64 {
        1.0 / (1.0 + self.height * bell(place, self.centre, self.width))
    }

    /// Relative standard deviation of the area `height·width`.
    pub(super) fn area_error(&self) -> f64 {
        let [height, _, width] = self.errors;
        (height * height + width * width + 2.0 * self.height_and_width).max(0.0).sqrt()
    }
}

/// The groups within half a width of the centre, or else the nearest.
fn around(groups: &[Group], centre: f64, width: f64) -> Vec<&Group> {
    let distance = |group: &&Group| (group.place - centre).abs();
    let inside: Vec<&Group> = groups.iter().filter(|group| distance(group) <= width / 2.0).collect();
    if inside.is_empty() {
        groups.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).into_iter().collect()
    } else {
        inside
    }
}

/// The two bells of a damped oscillation, at its positive and negative frequency.
fn bell(place: f64, centre: f64, width: f64) -> f64 {
    let at = |centre: f64| 1.0 / (1.0 + (2.0 * (place - centre) / width).powi(2));
    at(centre) + at(-centre)
}

fn groups(ordinates: &[f64], first: usize) -> Vec<Group> {
    let size = ordinates.len().div_ceil(GROUPS);
    let group = |(index, chunk): (usize, &[f64])| Group {
        place: (first + index * size) as f64 + (chunk.len() - 1) as f64 / 2.0,
        density: chunk.iter().sum::<f64>() / chunk.len() as f64,
        ordinates: chunk.len() as f64,
    };
    ordinates.chunks(size).enumerate().map(group).collect()
}

/// Modelled density of a group and its derivatives.
fn modelled(group: &Group, parameters: &Vector4<f64>) -> (f64, Vector4<f64>) {
    let (level, height, width) = (parameters[0].exp(), parameters[1].exp(), parameters[3].exp());
    let offset = 2.0 * (group.place - parameters[2]) / width;
    let near = 1.0 / (1.0 + offset * offset);
    let line = level * height * bell(group.place, parameters[2], width);
    let density = level + line;
    // The image at the negative frequency hardly changes with the parameters.
    let slope = level * height * near * near * offset;
    (density, Vector4::new(density, line, 4.0 * slope / width, 2.0 * slope * offset))
}

fn likelihood(groups: &[Group], parameters: &Vector4<f64>) -> f64 {
    let of = |group: &Group| {
        let (density, _) = modelled(group, parameters);
        -group.ordinates * (density.ln() + group.density / density)
    };
    groups.iter().map(of).sum()
}

/// Fisher's information and the score.
fn normal_equations(groups: &[Group], parameters: &Vector4<f64>) -> (Matrix4<f64>, Vector4<f64>) {
    let (mut information, mut score) = (Matrix4::zeros(), Vector4::zeros());
    for group in groups {
        let (density, slope) = modelled(group, parameters);
        let weight = group.ordinates / (density * density);
        information += weight * slope * slope.transpose();
        score += weight * (group.density - density) * slope;
    }
    (information, score)
}
