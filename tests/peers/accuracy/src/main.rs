//! How well the coefficients of known noise are found: series of a million samples at 100 Hz in three cases, this project
//! beside its peers, each on the very same series.
//!
//! ```console
//! $ cargo run --release -p peers-accuracy
//! $ python3 -m venv peers && peers/bin/pip install -r tests/peers/accuracy/requirements.txt
//! $ cargo run --release -p peers-accuracy -- --python peers/bin/python
//! ```

mod case;
mod imu_calib_crate;
mod ours;
mod python;
mod score;

use allan_core::NoiseTerm;
use anyhow::Result;
use case::{BATCH, CASES, Case, SAMPLES};
use clap::Parser;
use comfy_table::{Table, presets};
use python::Python;
use score::Scores;

/// Root mean square error (bias) of the coefficients, in percent of the truth.
#[derive(Parser)]
struct Cli {
    /// Series a case; rounded up to batches of six.
    #[arg(long, default_value_t = 72)]
    series: usize,
    /// First seed.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Interpreter in whose environment requirements.txt is installed; without, the peers in Python are left out.
    #[arg(long)]
    python: Option<String>,
    /// Only this project's own estimator.
    #[arg(long)]
    ours: bool,
}

fn main() -> Result<()> {
    let cli = Cli::parse();
    let mut python = cli.python.as_deref().map(Python::start).transpose()?;
    let batches = cli.series.div_ceil(BATCH) as u64;
    let mut table = Table::new();
    table.load_preset(presets::UTF8_FULL_CONDENSED).set_header(["case", "method", "N", "B", "K"]);
    for case in &CASES {
        let mut methods: Vec<(String, Scores)> = Vec::new();
        for seed in cli.seed..cli.seed + batches {
            let batch = case.series(seed);
            own(case, &batch, &mut methods);
            if !cli.ours {
                for series in &batch {
                    let found = imu_calib_crate::coefficients(series)?;
                    scores(&mut methods, "imu-calib 0.3.1").add(found, case.truth);
                }
            }
            if let Some(python) = &mut python {
                for answer in python.ask(&batch, &python_terms(case))? {
                    for found in answer.coefficients {
                        scores(&mut methods, &answer.method).add(found, case.truth);
                    }
                }
            }
        }
        let [n, b, k] = ours::limit(case).map(|limit| limit.map_or("–".to_owned(), score::percent));
        table.add_row([case.name.to_owned(), "information in the series".to_owned(), n, b, k]);
        for (method, Scores([n, b, k])) in methods {
            table.add_row([case.name.to_owned(), method, n.cell(), b.cell(), k.cell()]);
        }
    }
    println!(
        "{} series of {SAMPLES} samples a case; rms error and (bias) in percent of the truth",
        batches * BATCH as u64
    );
    println!("{table}");
    if python.is_none() {
        println!("not run: the peers in Python (--python)");
    }
    Ok(())
}

fn own(case: &Case, batch: &[Vec<f64>], methods: &mut Vec<(String, Scores)>) {
    let true_kinds = ours::true_kinds(case);
    for series in batch {
        for (method, kinds) in [("ours, true terms", &true_kinds[..]), ("ours, N, B and K", &NoiseTerm::BASELINE[..])] {
            let model = ours::fitted(case, series, kinds);
            let scores = scores(methods, method);
            scores.add(ours::coefficients(&model), case.truth);
            scores.add_bounds(ours::covered(case, &model));
        }
    }
}

fn scores<'a>(methods: &'a mut Vec<(String, Scores)>, name: &str) -> &'a mut Scores {
    let at = methods.iter().position(|(method, _)| method == name).unwrap_or_else(|| {
        methods.push((name.to_owned(), Scores::default()));
        methods.len() - 1
    });
    &mut methods[at].1
}

/// The terms of the case by the names of `allan-variance`.
fn python_terms(case: &Case) -> Vec<&'static str> {
    ["white", "flicker", "walk"].into_iter().zip(case.truth).filter(|(_, v)| *v > 0.0).map(|(name, _)| name).collect()
}
