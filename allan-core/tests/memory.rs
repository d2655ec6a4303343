//! The memory of an estimator, as the README states it.

use allan_core::Cascade;

#[test]
fn an_estimator_of_24_octaves_takes_the_bytes_of_the_readme() {
    let bytes = [size_of::<Cascade<24, 4>>(), size_of::<Cascade<24, 8>>(), size_of::<Cascade<24, 16>>()];
    assert_eq!(bytes, [2_784, 3_584, 5_184]);
    let readme = include_str!("../README.md");
    assert!(readme.contains("| 24 octaves | 2,784 | 3,584 | 5,184 |"), "the table of the README");
}
