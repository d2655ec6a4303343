//! Parts of documentation pages that tests generate.
//!
//! A part is between `<!-- begin NAME -->` and `<!-- end NAME -->`, each on its own line or within a line after a word. The test that calls
//! [`generated`] fails if the text of the part differs. `tests/docs.sh` sets `WRITE_DOCS`, with which the call writes the part instead. The
//! name of such a test contains `in_the_docs`, by which the script finds it.

use crate::{one_at_a_time, replace, target_folder, workspace};
use std::path::Path;

/// Asserts that the part `name` of a page is `text`, or writes it. `page` is the path relative to the workspace.
///
/// # Panics
/// The page has no such part, or the part differs and must not be written.
#[track_caller]
pub fn generated(page: &str, name: &str, text: &str) {
    Part { root: workspace(), page, name }.check(text, |old, new| old == new, writes_docs());
}

/// [`generated`] for measured figures. The words of the part must be those of `text`, and each number may differ by the relative
/// `tolerance`. A text within the tolerance is not written.
///
/// # Panics
/// Those of [`generated`].
#[track_caller]
pub fn generated_within(page: &str, name: &str, text: &str, tolerance: f64) {
    Part { root: workspace(), page, name }.check(text, |old, new| is_within(old, new, tolerance), writes_docs());
}

/// True if generated documentation is written instead of compared.
pub fn writes_docs() -> bool {
    std::env::var_os("WRITE_DOCS").is_some()
}

struct Part<'a> {
    root: &'a Path,
    page: &'a str,
    name: &'a str,
}

impl Part<'_> {
    #[track_caller]
    fn check(&self, text: &str, is_unchanged: impl Fn(&str, &str) -> bool, writes: bool) {
        let Self { root, page: name_of_page, name } = self;
        let path = root.join(name_of_page);
        // Another test may write a part of the same page at the same time.
        let _writing = writes.then(|| one_at_a_time(&target_folder().join("writing-docs")));
        let page = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{name_of_page}: {error}"));
        let [begin, end] = ["begin", "end"].map(|side| format!("<!-- {side} {name} -->"));
        for mark in [&begin, &end] {
            let times = page.matches(mark.as_str()).count();
            assert_eq!(times, 1, "{name_of_page}: the part \"{name}\" needs the mark {mark} once");
        }
        let parts = page.split_once(&begin).and_then(|(before, rest)| Some((before, rest.split_once(&end)?)));
        let Some((before, (old, after))) = parts else {
            panic!("{name_of_page}: the part \"{name}\" ends before it begins");
        };
        // Markdown treats a line that begins with a mark as a separate block.
        let is_in_line = before.rsplit('\n').next().is_some_and(|line| !line.trim().is_empty());
        assert!(
            is_in_line || old.starts_with('\n'),
            "{name_of_page}: the part \"{name}\" needs its marks on lines of their own, or a word before them"
        );
        let (old, new) = (if old.starts_with('\n') { old.trim_matches('\n') } else { old }, text.trim_matches('\n'));
        if is_unchanged(old, new) {
            return;
        }
        assert!(
            writes,
            "{name_of_page}: the part \"{name}\" is not what its test makes of it; run tests/docs.sh\n\
             --- the page has\n{old}\n--- the test makes\n{new}\n---"
        );
        let border = if page[before.len() + begin.len()..].starts_with('\n') { "\n" } else { "" };
        let page = format!("{before}{begin}{border}{new}{border}{end}{after}");
        replace(&path, |partial| std::fs::write(partial, page));
    }
}

/// True if two texts have the same words, and numbers within a relative tolerance of those of the first.
fn is_within(old: &str, new: &str, tolerance: f64) -> bool {
    let [old, new] = [old, new].map(WordsAndNumbers::of);
    let is_near = |(old, new): (&f64, &f64)| (new - old).abs() <= tolerance * old.abs();
    old.words == new.words && old.numbers.iter().zip(&new.numbers).all(is_near)
}

/// A text divided at its numbers.
struct WordsAndNumbers {
    words: Vec<String>,
    numbers: Vec<f64>,
}

impl WordsAndNumbers {
    /// Divides a text. A number has digits, optionally in groups of three, decimals, and the word "million" after it.
    fn of(text: &str) -> Self {
        let (mut words, mut numbers, mut rest) = (vec![String::new()], Vec::new(), text);
        while let Some(first) = rest.chars().next() {
            let length = length_of_number(rest);
            if length == 0 {
                words.last_mut().expect("one at least").push(first);
                rest = &rest[first.len_utf8()..];
                continue;
            }
            let number: f64 = rest[..length].replace(',', "").parse().expect("digits");
            rest = &rest[length..];
            let millions = rest.strip_prefix(" million");
            numbers.push(if millions.is_some() { 1e6 * number } else { number });
            rest = millions.unwrap_or(rest);
            words.push(String::new());
        }
        Self { words, numbers }
    }
}

/// Length in bytes of the number at the begin of a text.
fn length_of_number(text: &str) -> usize {
    let digits = |text: &str| text.bytes().take_while(u8::is_ascii_digit).count();
    let mut length = digits(text);
    if length == 0 {
        return 0;
    }
    while text[length..].strip_prefix(',').is_some_and(|group| digits(group) == 3) {
        length += 4;
    }
    let decimals = text[length..].strip_prefix('.').map_or(0, digits);
    if decimals > 0 { length + 1 + decimals } else { length }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::panic::{AssertUnwindSafe, catch_unwind};

    const PAGE: &str = "A page\n\n<!-- begin table -->\n| a | 1 |\n<!-- end table -->\n\nA push takes <!-- begin cost -->198<!-- end cost --> steps.\n";

    /// A page in its own temporary folder.
    struct Example(std::path::PathBuf);

    impl Example {
        fn new(name: &str, text: &str) -> Self {
            let folder = std::env::temp_dir().join(format!("generated-{name}-{}", std::process::id()));
            std::fs::create_dir_all(&folder).expect("a folder");
            std::fs::write(folder.join("page.md"), text).expect("room");
            Self(folder)
        }

        fn part<'a>(&'a self, name: &'a str) -> Part<'a> {
            Part { root: &self.0, page: "page.md", name }
        }

        fn text(&self) -> String {
            std::fs::read_to_string(self.0.join("page.md")).expect("the page")
        }

        /// The message with which this text of a part is refused.
        fn refusal(&self, name: &str, text: &str) -> String {
            let check = || self.part(name).check(text, |old, new| old == new, false);
            let panic = catch_unwind(AssertUnwindSafe(check)).expect_err("the part is refused");
            panic.downcast_ref::<String>().expect("a message").clone()
        }
    }

    impl Drop for Example {
        fn drop(&mut self) {
            let _it_may_be_gone = std::fs::remove_dir_all(&self.0);
        }
    }

    #[test]
    fn a_part_that_is_the_text_is_accepted_with_or_without_line_ends_at_its_borders() {
        let page = Example::new("same", PAGE);
        for text in ["| a | 1 |", "| a | 1 |\n"] {
            page.part("table").check(text, |old, new| old == new, false);
        }
        page.part("cost").check("198", |old, new| old == new, false);
        assert_eq!(page.text(), PAGE);
    }

    #[test]
    fn another_text_is_refused_with_both_texts_and_what_to_run() {
        let page = Example::new("other", PAGE);
        let message = page.refusal("table", "| a | 2 |");
        for told in ["page.md", "\"table\"", "| a | 1 |", "| a | 2 |", "run tests/docs.sh"] {
            assert!(message.contains(told), "{told} is not in {message}");
        }
        assert_eq!(page.text(), PAGE);
    }

    #[test]
    fn a_part_without_its_two_marks_is_refused_with_the_names_of_page_and_part() {
        for text in [
            "no marks",
            "A mark at the beginning of a line:\n<!-- begin cost -->198<!-- end cost -->",
            "<!-- begin cost -->198",
            "198<!-- end cost -->",
            "<!-- end cost -->198<!-- begin cost -->",
            "<!-- begin cost -->1<!-- end cost --><!-- begin cost -->1<!-- end cost -->",
        ] {
            let message = Example::new("marks", text).refusal("cost", "198");
            assert!(message.contains("page.md") && message.contains("\"cost\""), "{text}: {message}");
        }
        let absent = Example(std::env::temp_dir().join("generated-absent"));
        assert!(absent.refusal("cost", "198").starts_with("page.md: "));
    }

    #[test]
    fn writing_replaces_the_part_and_nothing_else() {
        let page = Example::new("written", PAGE);
        page.part("table").check("| a | 2 |\n| b | 3 |\n", |old, new| old == new, true);
        page.part("cost").check("205", |old, new| old == new, true);
        let expected = "A page\n\n<!-- begin table -->\n| a | 2 |\n| b | 3 |\n<!-- end table -->\n\nA push takes <!-- begin cost -->205<!-- end cost --> steps.\n";
        assert_eq!(page.text(), expected);
        assert_eq!(std::fs::read_dir(&page.0).expect("the folder").count(), 1, "no other file is left");
        let empty = Example::new("empty", "<!-- begin table -->\n<!-- end table -->\n");
        empty.part("table").check("| a | 2 |", |old, new| old == new, true);
        assert_eq!(empty.text(), "<!-- begin table -->\n| a | 2 |\n<!-- end table -->\n");
    }

    #[test]
    fn numbers_may_differ_by_the_tolerance_in_either_direction_and_words_may_not() {
        for (old, new, is_same) in [
            ("198 instructions", "198 instructions", true),
            ("200 instructions", "220 instructions", true),
            ("200 instructions", "180 instructions", true),
            ("200 instructions", "221 instructions", false),
            ("200 instructions", "179 instructions", false),
            ("200 instructions", "200 steps", false),
            ("200", "200 instructions", false),
            ("1,000 to 2,000", "1,090 to 1,910", true),
            ("1,000 to 2,000", "1,090 to 2,210", false),
            ("999", "1,001", true),
            ("30 million", "32.5 million", true),
            ("30 million", "30", false),
            ("30 million", "33.5 million", false),
            ("7.4 kB.", "7.2 kB.", true),
            ("7.4 kB", "8.2 kB", false),
            ("1, 2", "1, 3", false),
            ("| Cortex-M4F | 2²⁰ | — |", "| Cortex-M4F | 2²⁰ | — |", true),
            ("0", "0", true),
        ] {
            assert_eq!(is_within(old, new, 0.1), is_same, "{old:?} and {new:?}");
        }
    }

    #[test]
    fn a_figure_within_the_tolerance_is_not_written() {
        let page = Example::new("within", PAGE);
        page.part("cost").check("205", |old, new| is_within(old, new, 0.1), true);
        assert_eq!(page.text(), PAGE);
        page.part("cost").check("250", |old, new| is_within(old, new, 0.1), true);
        assert!(page.text().contains("-->250<!--"), "{}", page.text());
    }
}
