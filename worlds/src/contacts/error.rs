//! What can be wrong with a contact plan or a capacity trace, and on which line.

use std::fmt;

/// Why a contact plan or trace cannot be read.
///
/// ```
/// use farside_worlds::contacts::ContactPlan;
/// let text = "a range +0 +90 1 2 1\na contact +0 +60 1 2 1000\na contact +59 +90 1 2 1000";
/// let error = ContactPlan::from_ion(text.as_bytes()).unwrap_err();
/// assert_eq!(
///     error.to_string(),
///     "line 3: the contact from 1 to 2 overlaps that of line 2; \
///      contacts from one node to another must come one after the other"
/// );
/// assert_eq!(error.line(), Some(3));
/// ```
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ContactError {
    /// The file is larger than any that is read.
    #[error("the file has {actual_bytes} bytes; at most {limit_bytes} are read")]
    TooLarge {
        /// The most bytes that are read.
        limit_bytes: usize,
        /// The file's size.
        actual_bytes: usize,
    },
    /// The file is no text.
    #[error("line {line}: not text: a byte is not UTF-8")]
    NotText {
        /// The line, from 1.
        line: usize,
    },
    /// There is nothing in it.
    #[error("the file holds no {what}")]
    Empty {
        /// What it should hold.
        what: &'static str,
    },
    /// Something at one place is wrong.
    #[error("{at}: {problem}")]
    At {
        /// Where.
        at: Position,
        /// What.
        problem: ContactProblem,
    },
    /// Several things are wrong, in the order of their lines.
    #[error("{}{}", listed(.first), and_more(*.more))]
    Several {
        /// The first of them, at most [`MAX_FAULTS`].
        first: Vec<ContactError>,
        /// How many more there are.
        more: usize,
    },
}

/// The most faults of a file that are told one by one, and the most remarks on it.
pub const MAX_FAULTS: usize = 20;

impl ContactError {
    /// The line that is wrong, from 1, if it is one.
    pub fn line(&self) -> Option<usize> {
        match self {
            ContactError::NotText { line } => Some(*line),
            ContactError::At { at, .. } => Some(at.line),
            ContactError::Several { first, .. } => first.first()?.line(),
            ContactError::TooLarge { .. } | ContactError::Empty { .. } => None,
        }
    }

    /// Each of the faults that are told, one if there is one.
    ///
    /// ```
    /// use farside_worlds::contacts::ContactPlan;
    /// let text = b"a contact +0 +60 1 2\na contact +60 +x 1 2 1000";
    /// let error = ContactPlan::from_ion(text).unwrap_err();
    /// let lines: Vec<_> = error.faults().iter().map(|fault| fault.line()).collect();
    /// assert_eq!(lines, [Some(1), Some(2)]);
    /// ```
    pub fn faults(&self) -> &[ContactError] {
        match self {
            ContactError::Several { first, .. } => first,
            one => std::slice::from_ref(one),
        }
    }

    /// Whether a line ends too soon, or a file is too long: there is nothing more to look at.
    pub(super) fn ends_it(&self) -> bool {
        let ContactError::At { problem, .. } = self else {
            return true;
        };
        matches!(
            problem,
            ContactProblem::MissingField { .. } | ContactProblem::TooMany { .. }
        )
    }

    pub(super) fn at(line: usize, problem: ContactProblem) -> Self {
        let at = Position { line, column: None };
        ContactError::At { at, problem }
    }

    pub(super) fn at_column(line: usize, column: usize, problem: ContactProblem) -> Self {
        let column = Some(column);
        let at = Position { line, column };
        ContactError::At { at, problem }
    }
}

/// What was found wrong so far.
#[derive(Default)]
pub(super) struct Faults {
    first: Vec<ContactError>,
    more: usize,
}

impl Faults {
    pub(super) fn push(&mut self, error: ContactError) {
        match self.first.len() < MAX_FAULTS {
            true => self.first.push(error),
            false => self.more += 1,
        }
    }

    /// The value, or `None` once the fault is noted.
    pub(super) fn note<T>(&mut self, result: Result<T, ContactError>) -> Option<T> {
        result.map_err(|error| self.push(error)).ok()
    }

    pub(super) fn is_empty(&self) -> bool {
        self.first.is_empty()
    }

    /// An error, if anything was wrong.
    pub(super) fn check(mut self) -> Result<(), ContactError> {
        self.first.sort_by_key(ContactError::line);
        match (self.first.len(), self.more) {
            (0, _) => Ok(()),
            (1, 0) => Err(self.first.remove(0)),
            (_, more) => Err(ContactError::Several {
                first: self.first,
                more,
            }),
        }
    }
}

fn listed(faults: &[ContactError]) -> String {
    let lines: Vec<String> = faults.iter().map(ContactError::to_string).collect();
    lines.join("\n")
}

fn and_more(more: usize) -> String {
    match more {
        0 => String::new(),
        more => format!("\nand {more} more"),
    }
}

/// What is to be said of a plan that is read: what was passed over, and what has no effect.
#[derive(Clone, Debug, Default)]
pub(super) struct Remarks {
    first: Vec<String>,
    more: usize,
}

impl Remarks {
    /// One more, on a line of the file.
    pub(super) fn push(&mut self, line: usize, text: impl FnOnce() -> String) {
        match self.first.len() < MAX_FAULTS {
            true => self.first.push(format!("line {line}: {}", text())),
            false => self.more += 1,
        }
    }

    pub(super) fn all(&self) -> impl Iterator<Item = String> + '_ {
        let more = (self.more > 0).then(|| format!("and {} more remarks", self.more));
        self.first.iter().cloned().chain(more)
    }
}

/// Where in a file something is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Position {
    /// The line, from 1.
    pub line: usize,
    /// The column, from 1, in characters; `None` where the whole line is meant.
    pub column: Option<usize>,
}

impl fmt::Display for Position {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.column {
            Some(column) => write!(f, "line {}, column {column}", self.line),
            None => write!(f, "line {}", self.line),
        }
    }
}

/// What is wrong at one place of a file. Texts from the file are cut to 40 characters.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ContactProblem {
    /// A word that begins no line of this format.
    #[error("{found:?}: expected {expected}{}", did_you_mean(.nearest))]
    Directive {
        /// The word.
        found: String,
        /// What may stand here.
        expected: &'static str,
        /// The word closest to it that may.
        nearest: Option<&'static str>,
    },
    /// A field is missing at the end of a line.
    #[error("the {field} is missing: expected `{form}`")]
    MissingField {
        /// What is missing.
        field: &'static str,
        /// The whole line as it should be.
        form: &'static str,
    },
    /// There is more on the line than its form has.
    #[error("{found:?} is one field too many: expected `{form}`")]
    ExtraField {
        /// The first field too many.
        found: String,
        /// The whole line as it should be.
        form: &'static str,
    },
    /// A field's value cannot be.
    #[error("{field} {found:?}: expected {expected}")]
    Field {
        /// Which field.
        field: &'static str,
        /// Its value.
        found: String,
        /// What it should be.
        expected: &'static str,
    },
    /// The text is no JSON, or JSON of another shape.
    #[error("not an HDTN contact plan: {message}")]
    Json {
        /// What the JSON reader found and expected.
        message: String,
    },
    /// A contact lacks a key.
    #[error("the contact has no {key:?}, {meaning}{}", found_instead(.nearest))]
    MissingKey {
        /// The key.
        key: &'static str,
        /// What it holds, with its unit.
        meaning: &'static str,
        /// The key that may have been meant for it.
        nearest: Option<String>,
    },
    /// A contact has a key twice.
    #[error("the contact has {key:?} twice")]
    DuplicateKey {
        /// The key.
        key: &'static str,
    },
    /// Something ends before or as it begins.
    #[error("it ends at {end} and begins at {start}: expected an end after the beginning")]
    EndsBeforeItBegins {
        /// When it begins.
        start: String,
        /// When it ends.
        end: String,
    },
    /// A contact begins before the time that the plan counts from.
    #[error("it begins {seconds} s before the reference time that the `@` line sets")]
    BeforeReference {
        /// How long before \[s\].
        seconds: u64,
    },
    /// A time lies further from the plan's beginning than can be counted.
    #[error("{found}: more than 584 years from the plan's beginning")]
    TooLate {
        /// Which time.
        found: &'static str,
    },
    /// Two contacts of one ordered pair overlap.
    #[error(
        "the contact from {from} to {to} overlaps that of line {other_line}; contacts from one \
         node to another must come one after the other"
    )]
    Overlap {
        /// The sending node.
        from: String,
        /// The receiving node.
        to: String,
        /// The line of the other contact.
        other_line: usize,
    },
    /// Two ranges of one ordered pair overlap.
    #[error(
        "the range from {from} to {to} overlaps that of line {other_line}; there is one distance \
         at a time"
    )]
    RangeOverlap {
        /// The first node.
        from: String,
        /// The second node.
        to: String,
        /// The line of the other range.
        other_line: usize,
    },
    /// No range tells the light time of any contact; this is the first.
    #[error(
        "no range covers the contact from {from} to {to} at {at}, when it begins, and there is no \
         other contact; expected `a range` over it, or range = \"...\" in [contacts]"
    )]
    NoRange {
        /// The sending node.
        from: String,
        /// The receiving node.
        to: String,
        /// The first instant without a range, from the plan's beginning.
        at: String,
    },
    /// Some times are dates, others count from an instant that the file does not tell.
    #[error(
        "times such as +0 beside dates: expected an `@` line with a date before them, which says \
         what +0 is"
    )]
    MixedTimes,
    /// More entries than anyone means.
    #[error("more than {limit} {what}; that is the most that is read")]
    TooMany {
        /// What there is too much of.
        what: &'static str,
        /// The most there may be.
        limit: usize,
    },
    /// A stamp of a trace is earlier than the one before.
    #[error("{found} ms after {before} ms: stamps must not decrease")]
    Decreases {
        /// The stamp \[ms\].
        found: u64,
        /// The stamp before it \[ms\].
        before: u64,
    },
    /// A trace lasts for no time at all.
    #[error("the last stamp is 0 ms: it is the trace's period, and must be at least 1 ms")]
    NoPeriod,
}

fn did_you_mean(nearest: &Option<&'static str>) -> String {
    nearest.map_or_else(String::new, |name| format!("; did you mean {name:?}?"))
}

fn found_instead(nearest: &Option<String>) -> String {
    match nearest {
        Some(key) => format!("; found {key:?} instead"),
        None => String::new(),
    }
}

/// A text from a file, short enough for a message.
pub(crate) fn shown(text: &str) -> String {
    match text.char_indices().nth(40) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}
