//! The cost tables in the documentation of allan-core's calls: the counts of the images, and the flash that a call
//! adds.

use crate::image::{Core, M0_PLUS, M4F};
use crate::{TOLERANCE, figure};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use system_tests::{generated_within, workspace, writes_docs};

/// Rows of a table: the text of the first cell, and the name of the metric.
const METRICS: [(&str, &str); 9] = [
    ("instructions", "average"),
    ("instructions on average", "average"),
    ("instructions at most", "most"),
    ("instructions of the next sample, 1 missing", "1"),
    ("instructions of the next sample, 100 missing", "100"),
    ("instructions of the next sample, 2²⁰ missing", "longest"),
    ("instructions that add two terms", "most"),
    ("stack, bytes", "stack"),
    ("flash, bytes", FLASH),
];

/// The metric for which an image of its own is built.
const FLASH: &str = "flash";

/// A table of costs: a call, and its rows with a cell for each core.
struct Table {
    call: String,
    rows: Vec<(String, [String; 2])>,
    /// The line of code that the table documents.
    documented: String,
}

fn sources(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    let files = |path: PathBuf| if path.is_dir() { sources(&path) } else { vec![path] };
    let mut sources: Vec<PathBuf> = entries.flat_map(files).collect();
    sources.sort();
    sources
}

/// The tables of a source file: under `# Cost`, with the call's name in backquotes in the first cell.
fn tables(source: &str) -> Vec<Table> {
    let mut tables = Vec::new();
    for (at, _) in source.match_indices("/// # Cost\n") {
        let mut lines = source[at..].lines().map(str::trim).skip_while(|line| !line.starts_with("/// |"));
        let cells = |line: &str| -> Vec<String> {
            line.trim_start_matches("/// |")
                .trim_end_matches('|')
                .split('|')
                .map(|cell| cell.trim().to_owned())
                .collect()
        };
        let header = cells(lines.next().expect("a table"));
        assert_eq!(header[1..], ["Cortex-M4F", "Cortex-M0+"], "the columns of {}", header[0]);
        let call = header[0].trim_matches('`').to_owned();
        assert!(lines.next().is_some_and(|line| line.starts_with("/// |---|")), "{call}: no table");
        let (mut rows, mut documented) = (Vec::new(), String::new());
        for line in lines {
            if line.starts_with("/// |") {
                let [metric, first, second] = cells(line).try_into().expect("three cells");
                rows.push((metric, [first, second]));
            } else if !line.starts_with("///") && !line.starts_with("#[") {
                documented = line.to_owned();
                break;
            }
        }
        tables.push(Table { call, rows, documented });
    }
    tables
}

/// The count of a core for a metric of a call; `None` if it is not counted on that core.
fn measured(core: Core, call: &str, metric: &str) -> Option<f64> {
    if metric == FLASH {
        // The size is measured on one core only, since each image takes seconds to build.
        let is_m4f = core.target() == driver_footprint::M4F;
        return is_m4f.then(|| f64::from(driver_footprint::call_bytes(driver_footprint::M4F, call)));
    }
    let name = match (call, metric) {
        // This is the image that counts records of sensor noise, on the Cortex-M4F only.
        ("trace::trace", "average") => "trace_nothing".into(),
        ("trace::trace", "most") => "trace_tone".into(),
        ("trace::trace", "stack") => "trace_tone_stack".into(),
        ("CovariateRegression::sensitivities", "average") => "sensitivities".into(),
        ("CovariateRegression::sensitivities", "stack") => "sensitivities_stack".into(),
        _ => format!("{call} {metric}"),
    };
    core.counts().get(&name)
}

/// Parses a count of a table: 1,234 or 12.3 million.
fn number(cell: &str) -> f64 {
    let (digits, factor) = cell.strip_suffix(" million").map_or((cell, 1.0), |digits| (digits, 1e6));
    digits.replace(',', "").parse::<f64>().unwrap_or_else(|_| panic!("{cell} is no number")) * factor
}

/// Writes a count for a table, with three digits.
fn cell(count: Option<f64>) -> String {
    let Some(count) = count else { return "—".to_owned() };
    let unit = 10_f64.powf((count.max(1.0).log10().floor() - 2.0).max(0.0));
    figure((count / unit).round() * unit)
}

/// True if a cell has this count. It may change by a tenth with the compiler, or by some instructions or words if it is small.
fn is_stated(count: Option<f64>, stated: &str) -> bool {
    let is_near = |count: f64| (count - number(stated)).abs() <= TOLERANCE * number(stated) + 16.0;
    count.map_or(stated == "—", is_near)
}

pub(crate) fn the_documentation_of_each_call_has_its_counts() {
    let documented = check_tables(|metric| metric != FLASH);
    let counted = M4F.counts().calls();
    let missing: Vec<_> = counted.iter().filter(|&&call| !documented.contains(call)).collect();
    assert!(missing.is_empty() && !counted.is_empty(), "without a table: {missing:?}");
    write_counts_of_serialize();
}

pub(crate) fn the_documentation_of_each_call_has_its_flash() {
    check_tables(|metric| metric == FLASH);
    let flash = cell(measured(M4F, "Serialize", FLASH));
    generated_within("allan-core/guide/costs.md", "flash of Serialize", &flash, TOLERANCE);
}

/// Compares the rows of all tables whose metric is `wanted`; returns the calls that have a table.
fn check_tables(wanted: impl Fn(&str) -> bool) -> BTreeSet<String> {
    let mut wrong = String::new();
    let mut documented = BTreeSet::new();
    for path in sources(&workspace().join("allan-core/src")) {
        let source = std::fs::read_to_string(&path).expect("a file");
        let mut written = source.clone();
        for Table { call, rows, documented: code } in tables(&source) {
            let function = call.rsplit("::").next().unwrap_or_default();
            let names_it = code.contains(&format!("fn {function}(")) || code.contains(&format!("fn {function}<"));
            assert!(names_it, "the table of {call} documents: {code}");
            for (label, cells) in &rows {
                let metric = METRICS.iter().find(|(text, _)| text == label);
                let metric = metric.unwrap_or_else(|| panic!("{call}: no number is called {label}")).1;
                if !wanted(metric) {
                    continue;
                }
                let found = [M4F, M0_PLUS].map(|core| measured(core, &call, metric));
                if found.iter().zip(cells).all(|(&count, stated)| is_stated(count, stated)) {
                    continue;
                }
                let row = |cells: &[String; 2]| format!("/// | {label} | {} | {} |\n", cells[0], cells[1]);
                let new = row(&found.map(cell));
                wrong += &format!("{call}: not\n{}but\n{new}", row(cells));
                let table = written.find(&format!("/// | `{call}` |")).expect("the table");
                let after = written.split_off(table);
                written += &after.replacen(&row(cells), &new, 1);
            }
            let has = |start: &str| rows.iter().any(|(label, _)| label.starts_with(start));
            assert!(has("instructions") && has("stack") && has("flash"), "a figure of {call} is missing");
            assert!(documented.insert(call.clone()), "{call} has two tables");
        }
        if writes_docs() && written != source {
            std::fs::write(&path, written).expect("room");
        }
    }
    assert!(wrong.is_empty() || writes_docs(), "allan-core/src is to be changed; run tests/docs.sh\n{wrong}");
    documented
}

/// A derived implementation has no place for a table, so its costs are on the page.
fn write_counts_of_serialize() {
    let mut table = "| `Serialize` | Cortex-M4F | Cortex-M0+ |\n|---|---|---|\n".to_owned();
    for (label, metric) in [("instructions", "average"), ("stack, bytes", "stack")] {
        let [first, second] = [M4F, M0_PLUS].map(|core| cell(measured(core, "Serialize", metric)));
        table += &format!("| {label} | {first} | {second} |\n");
    }
    generated_within("allan-core/guide/costs.md", "serialize", &table, TOLERANCE);
}
