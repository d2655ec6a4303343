//! The words of a sentence that do not depend on the record, and the page of the documentation that explains them.

/// `docs/findings.md` with single spaces in the place of line breaks.
pub(crate) fn documentation() -> String {
    let page =
        std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/findings.md")).expect("the page");
    page.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// The parts of a sentence between numbers, names and punctuation that have two words or more.
pub(crate) fn phrases(sentence: &str) -> Vec<String> {
    let is_word = |word: &str| !word.is_empty() && word.chars().all(|letter| letter.is_alphabetic() || letter == '-');
    let is_name = |word: &str| {
        ["gyro", "gyros", "accel", "accels", "x", "y", "z", "N", "B", "K", "h", "s", "min", "d", "ms"].contains(&word)
    };
    let mut phrases = vec![String::new()];
    for word in sentence.split_whitespace() {
        let bare = word.trim_matches(|letter: char| ".,:;()!".contains(letter));
        let last = phrases.last_mut().expect("one at least");
        if is_word(bare) && !is_name(bare) {
            *last += &format!("{}{bare}", if last.is_empty() { "" } else { " " });
        }
        if !is_word(bare) || is_name(bare) || bare != word {
            phrases.push(String::new());
        }
    }
    phrases.retain(|phrase| phrase.contains(' '));
    phrases
}
