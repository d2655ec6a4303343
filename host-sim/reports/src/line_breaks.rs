//! Text broken into lines.

/// Units that are letters alone.
const SIMPLE_UNITS: [&str; 11] = ["s", "ms", "min", "h", "d", "Hz", "kHz", "g", "mg", "V", "mV"];

/// `text` in lines of at most `width` columns, all but the first with `indent`; longer words are broken.
pub(crate) fn broken(text: &str, width: usize, indent: &str) -> Vec<String> {
    let width = width.max(1);
    let indent = if indent.chars().count() < width { indent } else { "" };
    let mut lines: Vec<String> = Vec::new();
    let mut line: String = text.chars().take_while(|letter| *letter == ' ').collect();
    let mut is_empty = true;
    for piece in pieces(text.trim_start()) {
        let length = line.chars().count() + usize::from(!is_empty) + piece.chars().count();
        if !is_empty && length > width {
            lines.push(line.trim_end().to_owned());
            line = indent.to_owned();
            is_empty = true;
        }
        if !is_empty {
            line.push(' ');
        }
        line.push_str(&piece);
        is_empty = false;
        while line.chars().count() > width {
            let head: String = line.chars().take(width).collect();
            let tail: String = line.chars().skip(width).collect();
            lines.push(head);
            line = format!("{indent}{tail}");
        }
    }
    lines.push(line.trim_end().to_owned());
    lines
}

/// Pieces that stay on one line: a word, or a number with bound and unit.
fn pieces(text: &str) -> Vec<String> {
    let mut pieces: Vec<String> = Vec::new();
    for word in text.split(' ') {
        match pieces.last_mut() {
            Some(piece) if word == "±" || piece.ends_with('±') || is_unit_of(piece, word) => {
                piece.push(' ');
                piece.push_str(word);
            }
            _ => pieces.push(word.to_owned()),
        }
    }
    pieces
}

fn is_unit_of(piece: &str, word: &str) -> bool {
    let word = word.trim_end_matches([',', ';', '.', ':', ')']);
    let is_unit = SIMPLE_UNITS.contains(&word) || word.contains(['%', '°', 'µ', 'σ', '/', '√']);
    piece.ends_with(|last: char| last.is_ascii_digit()) && is_unit
}

#[cfg(test)]
mod tests {
    use super::broken;

    #[test]
    fn long_text_is_broken_between_words() {
        let text = "• sinusoid: ".to_owned() + &"word ".repeat(60);
        let lines = broken(&text, 100, "  ");
        assert!(lines.len() > 2 && lines.iter().all(|line| line.chars().count() <= 100));
        assert!(lines[1..].iter().all(|line| line.starts_with("  word")));
        assert_eq!(lines.join(" ").split_whitespace().count(), text.split_whitespace().count());
    }

    #[test]
    fn a_short_sentence_is_unchanged() {
        assert_eq!(broken("• step: at 3 s", 100, "  "), ["• step: at 3 s"]);
        assert_eq!(broken(" 1  gyro z", 100, ""), [" 1  gyro z"]);
    }

    #[test]
    fn a_number_stays_with_its_unit_and_its_bound() {
        assert_eq!(broken("For ±20 % it", 7, ""), ["For", "±20 %", "it"]);
        assert_eq!(
            broken("It wants 2.1 h. A line at 20.50 ± 0.02 Hz.", 20, ""),
            ["It wants 2.1 h. A", "line at", "20.50 ± 0.02 Hz."]
        );
    }

    #[test]
    fn a_word_longer_than_a_line_is_broken() {
        assert_eq!(broken("in abcdefghij", 4, ""), ["in", "abcd", "efgh", "ij"]);
        assert_eq!(broken("in a", 1, "  "), ["i", "n", "a"]);
        assert_eq!(broken("a", 0, "  "), ["a"]);
    }
}
