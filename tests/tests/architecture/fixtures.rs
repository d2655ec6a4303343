//! Applies the checks to small crates with and without violations.

use super::modules::Crate;
use super::{Package, circles, describe_circles, describe_dependencies, describe_double_names};
use std::path::Path;

/// Writes a crate from pairs of a file name in `src` and its text, and reads it.
fn with_crate<T>(files: &[(&str, &str)], inspect: impl FnOnce(&Crate, &Path) -> T) -> T {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, text) in files {
        let file = folder.path().join(name);
        std::fs::create_dir_all(file.parent().expect("a folder")).expect("a folder");
        std::fs::write(file, text).expect("room");
    }
    inspect(&Crate::read(&folder.path().join("lib.rs")), folder.path())
}

/// The files of each circle.
fn circles_of(files: &[(&str, &str)]) -> Vec<Vec<String>> {
    with_crate(files, |read, root| {
        let name = |file: &Path| file.strip_prefix(root).expect("inside").display().to_string();
        let uses = read.uses();
        let circles = circles(&uses).into_iter().map(|circle| circle.into_iter().map(name).collect());
        circles
            .map(|mut names: Vec<String>| {
                names.sort();
                names
            })
            .collect()
    })
}

#[test]
fn a_tree_has_no_circle() {
    let lib = "pub mod curve; mod fit; pub use fit::{Fit, fit}; #[cfg(test)] mod tests;";
    let curve =
        "use std::fmt; pub struct Curve; impl fmt::Debug for Curve {} #[cfg(test)] mod tests { use crate::Fit; }";
    let fit = "mod step; use crate::curve::Curve; pub struct Fit; pub fn fit(_: &Curve) -> Fit { step::step(); Fit }";
    let step = "use crate::curve; pub(super) fn step() { let _ = curve::Curve; }";
    assert_eq!(
        circles_of(&[("lib.rs", lib), ("curve.rs", curve), ("fit.rs", fit), ("fit/step.rs", step)]),
        [[""; 0]; 0]
    );
}

#[test]
fn a_direct_circle_is_found() {
    let a = "pub struct A; fn a() { crate::b::b(); }";
    let b = "use super::a::A; pub fn b() -> A { A }";
    assert_eq!(circles_of(&[("lib.rs", "mod a; mod b;"), ("a.rs", a), ("b.rs", b)]), [["a.rs", "b.rs"]]);
}

#[test]
fn a_circle_of_three_is_found() {
    let a = "use crate::b; pub struct A(b::B);";
    let b = "use crate::c::{self, C}; pub struct B(C);";
    let c = "pub struct C; impl C { fn c() { println!(\"{}\", crate::a::A::NAME); } }";
    assert_eq!(
        circles_of(&[("lib.rs", "mod a; mod b; mod c;"), ("a.rs", a), ("b.rs", b), ("c.rs", c)]),
        [["a.rs", "b.rs", "c.rs"]]
    );
}

#[test]
fn a_circle_of_parent_and_child_is_found() {
    let parent = "mod child; pub struct Parent(child::Child);";
    let child = "pub struct Child; impl super::Parent { fn child() {} }";
    assert_eq!(
        circles_of(&[("lib.rs", "mod parent;"), ("parent.rs", parent), ("parent/child.rs", child)]),
        [["parent.rs", "parent/child.rs"]]
    );
    // The parent only re-exports the child's item, which does not count as a use.
    let parent = "mod child; pub use child::Child; pub struct Parent;";
    assert_eq!(
        circles_of(&[("lib.rs", "mod parent;"), ("parent.rs", parent), ("parent/child.rs", child)]),
        [[""; 0]; 0]
    );
}

#[test]
fn a_circle_through_re_exports_is_found() {
    let lib = "mod a; mod b; pub use a::*; pub use b::B as Renamed;";
    let a = "pub struct A; fn a(_: crate::Renamed) {}";
    let b = "use crate::A; pub struct B(A);";
    assert_eq!(circles_of(&[("lib.rs", lib), ("a.rs", a), ("b.rs", b)]), [["a.rs", "b.rs"]]);
}

#[test]
fn a_circle_of_folders_is_found() {
    let files = [
        ("lib.rs", "mod line; mod noise;"),
        ("line.rs", "mod find; pub mod shape;"),
        ("line/find.rs", "use crate::noise::level::level; fn find() { level(); }"),
        ("line/shape.rs", "pub struct Shape;"),
        ("noise.rs", "pub mod level; mod draw;"),
        ("noise/level.rs", "pub fn level() {}"),
        ("noise/draw.rs", "fn draw() { crate::line::shape::Shape; }"),
    ];
    assert_eq!(circles_of(&files), [[""; 0]; 0], "no circle of files");
    let text = with_crate(&files, |read, root| describe_circles(&read.uses(), root));
    assert_eq!(text, "circle of 2:\n  line uses noise: level\n  noise uses line: Shape\n");
}

#[test]
fn public_types_that_share_a_name_are_found_and_re_exports_are_not() {
    let lib = "mod a; mod b; pub use a::Line; pub struct Curve; struct Private;";
    let a = "pub struct Line; pub(crate) struct Inner; bitflags! { pub struct Curve: u8 {} }";
    let b = "pub enum Line {} pub(crate) struct Inner; pub struct Private;";
    with_crate(&[("lib.rs", lib), ("a.rs", a), ("b.rs", b)], |read, root| {
        let double = describe_double_names(&read.public_types, root);
        assert_eq!(double, "Curve: a.rs, lib.rs\nLine: a.rs, b.rs\n");
    });
}

#[test]
fn a_dependency_that_is_not_allowed_is_found() {
    let package = |name: &str, dependency: &str| Package {
        name: name.to_owned(),
        dependencies: vec![dependency.to_owned()],
        roots: Vec::new(),
    };
    let packages = [package("firmware", "link"), package("allan-core", "link"), package("attic", "link")];
    assert_eq!(describe_dependencies(&packages), "allan-core depends on link\nattic is not in the table\n");
}
