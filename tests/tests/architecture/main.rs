//! The architecture of the workspace. Crates have only the dependencies of a table, modules form no cycle, and no two
//! public types have the same name. Tests access the measured recordings by one function.
//!
//! `WORKSPACE_ROOT` names another checkout to check.

mod fixtures;
mod modules;

use modules::{Crate, Uses};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The crates of the workspace on which each crate may depend. Dependencies of tests are not restricted.
///
/// The driver and `allan-core` depend on no other crate of the workspace. `readers` handle files without the driver and without statistics;
/// `time-base` handles time stamps without files; `recordings` adds the formats of the ADIS16405. `measurement` is the interface from
/// `recordings` to `noise-analysis`, so recordings have no statistics, and the analysis has no file, driver, firmware or virtual sensor.
/// `measurement` needs `allan-core` only to describe a sensor's filters. The virtual sensor is written from the data sheet alone, so that
/// it can check the driver. Reports contain findings of `noise-analysis` with models of `allan-core`. No crate depends on the benchmarks.
#[rustfmt::skip]
const MAY_DEPEND_ON: &[(&str, &str)] = &[
    ("adis16405-driver", ""),
    ("allan-core", ""),
    ("allan-core-ffi", "allan-core"),
    ("link", ""),
    ("firmware", "adis16405-driver allan-core link"),
    ("image-file", ""),
    ("example-board", "firmware link"),
    ("fourier", ""),
    ("measurement", "allan-core"),
    ("time-base", ""),
    ("readers", "time-base"),
    ("recordings", "adis16405-driver link measurement readers time-base"),
    ("noise-analysis", "allan-core fourier measurement"),
    ("virtual-sensor", ""),
    ("simulation", "adis16405-driver firmware link recordings virtual-sensor"),
    ("reports", "allan-core noise-analysis time-base"),
    ("browser", "adis16405-driver link measurement noise-analysis observatory recordings reports simulation"),
    ("benchmarks", "adis16405-driver allan-core fourier measurement noise-analysis recordings reports simulation virtual-sensor"),
    ("observatory", "adis16405-driver link measurement noise-analysis recordings reports simulation"),
    ("host-sim", "adis16405-driver link measurement noise-analysis observatory recordings reports simulation"),
    ("imunoise-python", "allan-core host-sim noise-analysis recordings reports"),
    ("system-tests", "emulation"),
    ("emulation", "virtual-sensor"),
    ("driver-footprint", "adis16405-driver allan-core system-tests"),
    ("allan-core-c", "allan-core"),
    ("fuzz", "adis16405-driver allan-core allan-core-c firmware link measurement recordings reports simulation virtual-sensor"),
    ("instruction-counts", "adis16405-driver allan-core"),
];

/// The variable that names the folder of the measured recordings.
const RECORDINGS: &str = concat!("ADIS_", "RECORDINGS");

struct Package {
    name: String,
    /// Crates of the workspace on which the crate depends, without those of tests and build scripts.
    dependencies: Vec<String>,
    /// Root files of the library and of the programs.
    roots: Vec<PathBuf>,
}

fn workspace() -> PathBuf {
    let here = || Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the tests live in the workspace").to_owned();
    std::env::var_os("WORKSPACE_ROOT").map_or_else(here, PathBuf::from).canonicalize().expect("a folder")
}

fn packages() -> Vec<Package> {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--no-deps", "--offline", "--format-version", "1"])
        .current_dir(workspace())
        .output()
        .expect("cargo starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let list = |value: &Value| value.as_array().expect("a list").clone();
    let text = |value: &Value| value.as_str().expect("a text").to_owned();
    let package = |package: Value| {
        let own = |dependency: &Value| dependency["path"].is_string() && dependency["kind"].is_null();
        let root = |target: &Value| {
            list(&target["kind"]).iter().any(|kind| ["lib", "bin", "proc-macro"].contains(&kind.as_str().unwrap_or("")))
        };
        let dependencies = list(&package["dependencies"]);
        let targets = list(&package["targets"]);
        Package {
            name: text(&package["name"]),
            dependencies: dependencies.iter().filter(|&each| own(each)).map(|each| text(&each["name"])).collect(),
            roots: targets.iter().filter(|&each| root(each)).map(|each| text(&each["src_path"]).into()).collect(),
        }
    };
    list(&metadata["packages"]).into_iter().map(package).collect()
}

/// Cycles: sets of files each of which uses every other one of its set, directly or through further files.
fn circles(uses: &Uses) -> Vec<BTreeSet<&Path>> {
    let reached = |from: &Path| {
        let mut reached = BTreeSet::new();
        let mut open = vec![from.to_owned()];
        while let Some(file) = open.pop() {
            let next = uses.get(&file).into_iter().flat_map(BTreeMap::keys);
            open.extend(next.filter(|&next| reached.insert(next.clone())).cloned());
        }
        reached
    };
    let reached: BTreeMap<&Path, BTreeSet<PathBuf>> = uses.keys().map(|file| (file.as_path(), reached(file))).collect();
    let circle = |file: &Path| -> BTreeSet<&Path> {
        let both_ways = |other: &&Path| reached[file].contains(*other) && reached[other].contains(file);
        reached.keys().copied().filter(both_ways).collect()
    };
    let circles: BTreeSet<_> = reached.keys().map(|file| circle(file)).filter(|circle| circle.len() > 1).collect();
    circles.into_iter().collect()
}

/// The uses between the modules of each folder; a module includes those below it.
fn between_modules(uses: &Uses) -> Uses {
    let mut between = Uses::new();
    for (file, used) in uses {
        for (other, names) in used {
            let same = file.components().zip(other.components()).take_while(|(one, another)| one == another).count();
            let module = |path: &Path| path.components().take(same + 1).collect::<PathBuf>().with_extension("");
            // `a.rs` and the files in `a/` are one module of the folder that contains both.
            if module(file) != module(other) {
                between.entry(module(file)).or_default().entry(module(other)).or_default().extend(names.clone());
            }
        }
    }
    between
}

/// The cycles of files, and those of modules of several files, with the names by which each uses the next.
fn describe_circles(uses: &Uses, root: &Path) -> String {
    let between = between_modules(uses);
    let of_files = circles(uses);
    let module = |files: &BTreeSet<&Path>| files.iter().map(|file| file.with_extension("")).collect();
    let described: Vec<BTreeSet<PathBuf>> = of_files.iter().map(module).collect();
    let mut of_modules = circles(&between);
    of_modules.retain(|circle| !described.contains(&module(circle)));
    let mut text = String::new();
    for (uses, circle) in
        of_files.iter().map(|circle| (uses, circle)).chain(of_modules.iter().map(|circle| (&between, circle)))
    {
        writeln!(text, "circle of {}:", circle.len()).expect("memory");
        for &user in circle {
            for (used, names) in uses[user].iter().filter(|(used, _)| circle.contains(used.as_path())) {
                let [user, used] = [user, used].map(|path| path.strip_prefix(root).unwrap_or(path).display());
                let names: Vec<&str> = names.iter().map(String::as_str).collect();
                writeln!(text, "  {user} uses {used}: {}", names.join(", ")).expect("memory");
            }
        }
    }
    text
}

/// Names and contents of the files that git tracks and whose names have these patterns.
fn tracked(root: &Path, patterns: &[&str]) -> Vec<(String, String)> {
    let output = Command::new("git").args(["ls-files", "-z", "--"]).args(patterns).current_dir(root).output();
    let output = output.expect("git starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let files = String::from_utf8(output.stdout).expect("names in UTF-8");
    let read = |file: &str| (file.to_owned(), std::fs::read_to_string(root.join(file)).unwrap_or_default());
    files.split_terminator('\0').map(read).collect()
}

/// Sources of the repository, in Rust or Python, that read the variable `ADIS_RECORDINGS`, without the function that
/// skips a test if a recording is absent.
fn readers_of_recordings(root: &Path) -> Vec<String> {
    let reads = |text: &str| text.contains(&format!("\"{RECORDINGS}\"")) || text.contains(&format!("'{RECORDINGS}'"));
    tracked(root, &["*.rs", "*.py"]).into_iter().filter(|(_, text)| reads(text)).map(|(file, _)| file).collect()
}

/// Names of public types that are defined more than once, each with its files.
fn describe_double_names(types: &[(String, PathBuf)], root: &Path) -> String {
    let mut places: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for (name, file) in types {
        places.entry(name).or_default().push(file.strip_prefix(root).unwrap_or(file).display().to_string());
    }
    places.retain(|_, places| places.len() > 1);
    places.iter().map(|(name, places)| format!("{name}: {}\n", places.join(", "))).collect()
}

/// Dependencies that the table does not allow.
fn describe_dependencies(packages: &[Package]) -> String {
    let mut text = String::new();
    for Package { name, dependencies, .. } in packages {
        let Some((_, allowed)) = MAY_DEPEND_ON.iter().find(|(package, _)| package == name) else {
            writeln!(text, "{name} is not in the table").expect("memory");
            continue;
        };
        for dependency in dependencies.iter().filter(|each| !allowed.split(' ').any(|name| name == each.as_str())) {
            writeln!(text, "{name} depends on {dependency}").expect("memory");
        }
    }
    text
}

/// Files of a crate's folder `tests` that `suite.rs`, its one test program, does not name. Their tests would not run.
fn files_outside_of_the_suite(folder: &Path) -> Vec<PathBuf> {
    let Ok(suite) = std::fs::read_to_string(folder.join("suite.rs")) else { return vec![] };
    let entries = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    let module = |path: &Path| {
        let is_module = path.extension().is_some_and(|ending| ending == "rs") || path.join("main.rs").is_file();
        is_module.then(|| path.file_stem().unwrap_or_default().to_string_lossy().into_owned())
    };
    let named = |name: &str| name == "suite" || suite.lines().any(|line| line == format!("mod {name};"));
    entries.filter(|path| module(path).is_some_and(|name| !named(&name))).collect()
}

#[test]
fn every_test_of_a_crate_is_in_its_suite() {
    let manifests = packages().into_iter().filter_map(|package| package.roots.into_iter().next());
    let folders: BTreeSet<PathBuf> = manifests
        .flat_map(|root| root.ancestors().skip(1).take(3).map(|folder| folder.join("tests")).collect::<Vec<_>>())
        .collect();
    assert!(folders.iter().filter(|folder| folder.join("suite.rs").is_file()).count() > 9);
    let outside: Vec<PathBuf> = folders.iter().flat_map(|folder| files_outside_of_the_suite(folder)).collect();
    assert_eq!(outside, [""; 0].map(PathBuf::from));
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("suite.rs"), "mod within;\n").expect("written");
    for file in ["within.rs", "without.rs"] {
        std::fs::write(folder.path().join(file), "").expect("written");
    }
    assert_eq!(files_outside_of_the_suite(folder.path()), [folder.path().join("without.rs")]);
}

#[test]
fn no_modules_of_a_crate_use_each_other_in_a_circle() {
    let root = workspace();
    let roots = packages().into_iter().flat_map(|package| package.roots);
    let circles: String = roots.map(|file| describe_circles(&Crate::read(&file).uses(), &root)).collect();
    assert!(circles.is_empty(), "\n{circles}");
}

#[test]
fn no_two_public_types_of_the_workspace_share_a_name() {
    let roots = packages().into_iter().flat_map(|package| package.roots);
    // The types of a file that two crates include are counted once.
    let types: BTreeSet<(String, PathBuf)> = roots
        .flat_map(|file| Crate::read(&file).public_types)
        .map(|(name, file)| (name, file.canonicalize().expect("a file")))
        .collect();
    let types: Vec<(String, PathBuf)> = types.into_iter().collect();
    let double = describe_double_names(&types, &workspace());
    assert!(double.is_empty(), "\n{double}");
}

#[test]
fn crates_depend_only_on_what_the_design_allows() {
    let refused = describe_dependencies(&packages());
    assert!(refused.is_empty(), "\n{refused}");
}

#[test]
fn tests_reach_the_measured_recordings_through_the_function_that_skips() {
    assert_eq!(readers_of_recordings(&workspace()), ["tests/src/lib.rs"]);
}

/// With ticks of 1/32,768 s a pause between two frames may end up to 30.5 us early. Without a feature a tick has a microsecond.
#[test]
fn embassy_time_has_ticks_of_a_microsecond() {
    let manifests = tracked(&workspace(), &["*Cargo.toml"]);
    let lines = manifests.iter().flat_map(|(file, text)| text.lines().map(move |line| (file, line)));
    let clocks: Vec<_> = lines.filter(|(_, line)| line.starts_with("embassy-time ")).collect();
    let is_right = |line: &str| line.matches("tick-hz-").count() == line.matches("\"tick-hz-1_000_000\"").count();
    assert!(clocks.len() >= 3 && clocks.iter().all(|(_, line)| is_right(line)), "{clocks:#?}");
}
