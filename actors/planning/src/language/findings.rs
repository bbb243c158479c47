//! What is wrong with a text, or odd, and where.

use std::fmt;

use super::tree::Form;
use crate::model::Position;
use crate::nearest::nearest;

/// How many findings are reported of one reading.
pub const MOST_FINDINGS: usize = 20;

/// How bad a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Severity {
    /// What was read is what was meant, as far as one can tell.
    Warning,
    /// Nothing is made of the text.
    Error,
}

/// Something that is wrong with a text, or odd.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// How bad it is.
    pub severity: Severity,
    /// The name of the file.
    pub file: String,
    /// The line and the character within it.
    pub position: Position,
    /// What would have been right there.
    pub expected: String,
    /// What is there.
    pub found: String,
    /// The known name that is nearest to the unknown one found.
    pub nearest: Option<String>,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let severity = match self.severity {
            Severity::Warning => "warning",
            Severity::Error => "error",
        };
        let (file, position) = (&self.file, self.position);
        let (expected, found) = (&self.expected, &self.found);
        write!(
            f,
            "{file}:{position}: {severity}: expected {expected}, found {found}"
        )?;
        match &self.nearest {
            Some(nearest) => write!(f, "; the nearest is {nearest}"),
            None => Ok(()),
        }
    }
}

/// The findings of a text of which nothing could be made, one a line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}", lines(.0))]
pub struct Findings(pub Vec<Finding>);

fn lines(findings: &[Finding]) -> String {
    let lines: Vec<String> = findings.iter().map(Finding::to_string).collect();
    lines.join("\n")
}

/// What a reading has found so far.
#[derive(Debug, Default)]
pub(super) struct Notes {
    /// The names of the files that are read.
    pub(super) files: Vec<String>,
    list: Vec<Finding>,
    omitted: usize,
    errors: usize,
}

impl Notes {
    /// Keeps a finding at a place.
    pub(super) fn note(
        &mut self,
        severity: Severity,
        position: Position,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) {
        let file = self.files.get(position.file as usize).cloned();
        self.push(Finding {
            severity,
            file: file.unwrap_or_default(),
            position,
            expected: expected.into(),
            found: found.into(),
            nearest: None,
        });
    }

    /// That something else than a form was expected.
    pub(super) fn error(&mut self, at: Form, expected: impl Into<String>) {
        self.note(Severity::Error, at.position(), expected, at.show());
    }

    /// That something is there which should not be, in other words than the text's.
    pub(super) fn refuse(
        &mut self,
        at: Form,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) {
        self.note(Severity::Error, at.position(), expected, found);
    }

    /// That something is odd, in other words than the text's.
    pub(super) fn warn(&mut self, at: Form, expected: impl Into<String>, found: impl Into<String>) {
        self.note(Severity::Warning, at.position(), expected, found);
    }

    /// That a name is not known.
    pub(super) fn unknown<'n>(
        &mut self,
        at: Form,
        expected: impl Into<String>,
        known: impl Iterator<Item = &'n str>,
    ) {
        let name = at.word();
        // To look for the nearest name takes longest: not for a finding that is not kept.
        let nearest = if self.has_room() {
            nearest(name, known)
        } else {
            None
        };
        let file = self.files.get(at.position().file as usize).cloned();
        self.push(Finding {
            severity: Severity::Error,
            file: file.unwrap_or_default(),
            position: at.position(),
            expected: expected.into(),
            found: at.show(),
            nearest: nearest.map(str::to_owned),
        });
    }

    /// Whether another error would be kept, so that it is worth its words.
    pub(super) fn has_room(&self) -> bool {
        self.list.len() < MOST_FINDINGS || self.list.iter().any(Finding::is_warning)
    }

    pub(super) fn has_errors(&self) -> bool {
        self.errors > 0
    }

    /// Keeps a finding: an error rather than a warning, and otherwise the first ones.
    pub(super) fn push(&mut self, finding: Finding) {
        self.errors += usize::from(!finding.is_warning());
        if self.list.len() == MOST_FINDINGS {
            self.omitted += 1;
            let warning = self.list.iter().rposition(Finding::is_warning);
            match warning.filter(|_| !finding.is_warning()) {
                Some(place) => self.list.remove(place),
                None => return,
            };
        }
        self.list.push(finding);
    }

    /// The findings in the order of the text, and how many more there were.
    pub(super) fn finish(mut self) -> (Vec<Finding>, usize) {
        self.list.sort_by_key(|finding| finding.position);
        (self.list, self.omitted)
    }
}

impl Finding {
    fn is_warning(&self) -> bool {
        self.severity == Severity::Warning
    }
}

/// How many arguments, in words.
pub(super) fn arguments(count: usize) -> String {
    match count {
        1 => "1 argument".to_owned(),
        _ => format!("{count} arguments"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_displace_warnings_and_the_rest_is_counted() {
        let finding = |severity, line| Finding {
            severity,
            file: String::new(),
            position: Position {
                file: 0,
                line,
                column: 1,
            },
            expected: String::new(),
            found: String::new(),
            nearest: None,
        };
        let mut notes = Notes::default();
        for line in 0..30 {
            notes.push(finding(Severity::Warning, 100 - line));
        }
        assert!(notes.has_room() && !notes.has_errors());
        for line in 0..21 {
            notes.push(finding(Severity::Error, 50 - line));
        }
        assert!(!notes.has_room() && notes.has_errors());
        let (list, omitted) = notes.finish();
        assert_eq!((list.len(), omitted), (MOST_FINDINGS, 31));
        assert!(list.is_sorted_by_key(|finding| finding.position));
        assert!(
            list.iter()
                .all(|finding| finding.severity == Severity::Error)
        );
    }
}
