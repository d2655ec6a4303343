//! The source of the smaller estimator, made of that of the larger one: cbindgen reads functions, not macros that define
//! them. The assertions on sizes in the source hold for both.

/// `cascade_24_8.rs` with 20 octaves and 4-fold overlap, without its comment on the file.
pub(crate) fn smaller(larger: &str) -> String {
    const CHANGED: [(&str, &str); 9] = [
        ("24_8", "20_4"),
        ("allan248", "allan204"),
        ("24 octaves (averaging factors up to 2^23 samples)", "20 octaves (averaging factors up to 2^19 samples)"),
        ("8-fold", "4-fold"),
        ("OCTAVES: usize = 24", "OCTAVES: usize = 20"),
        ("OVERLAP: usize = 8", "OVERLAP: usize = 4"),
        ("usize = 3592", "usize = 2344"),
        ("[u64; 449]", "[u64; 293]"),
        ("usize = 4500", "usize = 2940"),
    ];
    let code: String = larger.lines().filter(|line| !line.starts_with("//!")).flat_map(|line| [line, "\n"]).collect();
    CHANGED.iter().fold(code, |code, (from, to)| {
        assert!(code.contains(from), "cascade_24_8.rs has no {from}");
        code.replace(from, to)
    })
}
