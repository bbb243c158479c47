//! Patterns of a scenario over names of links or processors, each of which has to match something.

use farside::Pattern as Names;

use crate::link::LinkConfigError;

/// A pattern, and whether anything has matched it.
pub(super) struct Pattern {
    pub(super) key: Vec<String>,
    pub(super) text: String,
    pub(super) names: Names,
    pub(super) used: bool,
}

impl Pattern {
    pub(super) fn new(key: Vec<String>, text: &str) -> Result<Self, LinkConfigError> {
        match Names::over_names(text) {
            Ok(names) => Ok(Pattern {
                key,
                text: text.to_owned(),
                names,
                used: false,
            }),
            Err(error) => Err(LinkConfigError::BadPattern {
                key,
                pattern: text.to_owned(),
                error: error.to_string(),
            }),
        }
    }

    /// Whether it matches this name, and from then on has matched something.
    pub(super) fn matches(&mut self, name: &str) -> bool {
        let yes = self.names.matches(name);
        self.used |= yes;
        yes
    }
}

/// The name with `*` for each run of digits.
pub(super) fn shape(name: &str) -> String {
    let mut shape = String::with_capacity(name.len());
    for c in name.chars() {
        if !c.is_ascii_digit() {
            shape.push(c);
        } else if !shape.ends_with('*') {
            shape.push('*');
        }
    }
    shape
}
