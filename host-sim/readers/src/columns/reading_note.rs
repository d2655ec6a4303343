//! What is told of the reading of a file.

use std::fmt;

/// Most columns that a short note names.
const FEW: usize = 8;

/// A sentence for the user, or one about columns of the file.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct ReadingNote {
    /// Empty if the sentence is of no column.
    columns: Vec<String>,
    statement: String,
}

impl ReadingNote {
    /// `None` without columns.
    pub(crate) fn on_columns(columns: Vec<String>, statement: &str) -> Option<Self> {
        (!columns.is_empty()).then(|| Self { columns, statement: statement.to_owned() })
    }

    /// With the number of columns instead of many names.
    #[must_use]
    pub fn in_short(&self) -> String {
        match self.columns.len() {
            0..=FEW => self.to_string(),
            many => format!("{many} columns {}", self.statement),
        }
    }

    /// True if [`in_short`](Self::in_short) leaves out the names.
    #[must_use]
    pub fn has_many_columns(&self) -> bool {
        self.columns.len() > FEW
    }
}

impl From<String> for ReadingNote {
    fn from(statement: String) -> Self {
        Self { columns: Vec::new(), statement }
    }
}

/// `a, b left out: no unit`, or of many columns `60 columns left out: no unit. They are a, b, …`, which a screen may cut.
impl fmt::Display for ReadingNote {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names = listed(&self.columns);
        match self.columns.len() {
            0 => f.write_str(&self.statement),
            1..=FEW => write!(f, "{names} {}", self.statement),
            many => write!(f, "{many} columns {}. They are {names}", self.statement),
        }
    }
}

/// `a[0…8]` are nine elements of an array.
fn listed(names: &[String]) -> String {
    let element = |name: &str| {
        let (array, number) = name.strip_suffix(']')?.rsplit_once('[')?;
        Some((array.to_owned(), number.parse::<usize>().ok()?))
    };
    let mut all: Vec<String> = Vec::new();
    let mut rest = names;
    while let Some((first, after)) = rest.split_first() {
        let follows = |(at, name): &(usize, &String)| {
            element(first).is_some_and(|(array, start)| element(name) == Some((array, start + at)))
        };
        let elements = rest.iter().enumerate().take_while(follows).count();
        match element(first).filter(|_| elements > 1) {
            Some((array, start)) => all.push(format!("{array}[{start}…{}]", start + elements - 1)),
            None => all.push(first.clone()),
        }
        rest = if elements > 1 { &rest[elements..] } else { after };
    }
    all.join(", ")
}
