//! The error of the coefficients that this project and its peers estimate from series with known noise: three cases of
//! a million samples at 100 Hz, the same series for every method.
//!
//! ```console
//! $ cd tests/peers
//! $ cargo run --release --bin accuracy
//! $ python3 -m venv peers && peers/bin/pip install -r accuracy/requirements.txt
//! $ cargo run --release --bin accuracy -- --python peers/bin/python --likelihood peers/bin/python
//! ```

mod case;
mod methods;
mod score;

use allan_core::NoiseTerm;
use anyhow::Result;
use case::{BATCH, CASES, Case, SAMPLES};
use clap::Parser;
use comfy_table::{Table, presets};
use methods::Python;
use score::Scores;

/// Root mean square error (bias) of the coefficients, in percent of the true value.
#[derive(Parser)]
struct Cli {
    /// Number of series per case; rounded up to batches of six.
    #[arg(long, default_value_t = 72)]
    series: usize,
    /// First seed.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Interpreter in whose environment requirements.txt is installed; without, the peers in Python are left out.
    #[arg(long)]
    python: Option<String>,
    /// Interpreter with numpy and scipy, for the likelihood by exact covariances, half a second a series; without, it is left out.
    #[arg(long, value_name = "PYTHON")]
    likelihood: Option<String>,
    /// Only this project's own estimator, beside that likelihood if it is asked for.
    #[arg(long)]
    ours: bool,
}

fn main() -> Result<()> {
    let cli = Cli::parse();
    let scripts = [(&cli.python, "peers.py"), (&cli.likelihood, "likelihood.py")];
    let start = |(interpreter, script): (&Option<String>, &str)| {
        interpreter.as_deref().map(|interpreter| Python::start(interpreter, script))
    };
    let mut scripts = scripts.into_iter().filter_map(start).collect::<Result<Vec<Python>>>()?;
    let batches = cli.series.div_ceil(BATCH) as u64;
    let mut table = Table::new();
    table.load_preset(presets::UTF8_FULL_CONDENSED).set_header(["case", "method", "N", "B", "K"]);
    for case in &CASES {
        let mut scored: Vec<(String, Scores)> = Vec::new();
        for seed in cli.seed..cli.seed + batches {
            let batch = case.series(seed);
            score_own_fit(case, &batch, &mut scored);
            if !cli.ours {
                for series in &batch {
                    let estimate = methods::imu_calib_coefficients(series)?;
                    scores(&mut scored, "imu-calib 0.3.1").add(estimate, case.truth);
                }
            }
            for python in &mut scripts {
                for answer in python.ask(&batch, &python_terms(case))? {
                    for estimate in answer.coefficients {
                        scores(&mut scored, &answer.method).add(estimate, case.truth);
                    }
                }
            }
        }
        let [n, b, k] = methods::limit(case).map(|limit| limit.map_or("–".to_owned(), score::percent));
        table.add_row([case.name.to_owned(), "information in the series".to_owned(), n, b, k]);
        for (method, Scores([n, b, k])) in scored {
            table.add_row([case.name.to_owned(), method, n.cell(), b.cell(), k.cell()]);
        }
    }
    println!(
        "{} series of {SAMPLES} samples per case; rms error and (bias) in percent of the true value",
        batches * BATCH as u64
    );
    println!("{table}");
    if cli.python.is_none() {
        println!("not run: the peers in Python (--python)");
    }
    Ok(())
}

fn score_own_fit(case: &Case, batch: &[Vec<f64>], scored: &mut Vec<(String, Scores)>) {
    let true_kinds = methods::true_kinds(case);
    for series in batch {
        for (method, kinds) in [("ours, true terms", &true_kinds[..]), ("ours, N, B and K", &NoiseTerm::BASELINE[..])] {
            let model = methods::fitted(case, series, kinds);
            let by_samples =
                methods::fitted_to_samples(series, &model).map(|of| (format!("{method}, all samples"), of));
            for (method, model) in [(method.to_owned(), model)].into_iter().chain(by_samples) {
                let scores = scores(scored, &method);
                scores.add(methods::fitted_coefficients(&model), case.truth);
                scores.add_bounds(methods::covered(case, &model));
            }
        }
    }
}

fn scores<'a>(scored: &'a mut Vec<(String, Scores)>, name: &str) -> &'a mut Scores {
    let at = scored.iter().position(|(method, _)| method == name).unwrap_or_else(|| {
        scored.push((name.to_owned(), Scores::default()));
        scored.len() - 1
    });
    &mut scored[at].1
}

/// The names of the case's terms in `allan-variance`.
fn python_terms(case: &Case) -> Vec<&'static str> {
    ["white", "flicker", "walk"].into_iter().zip(case.truth).filter(|(_, v)| *v > 0.0).map(|(name, _)| name).collect()
}
