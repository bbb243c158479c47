//! Where in a scenario something stands.

/// The most characters of a `--set` argument that a message repeats.
pub(super) const MAX_SHOWN: usize = 80;

/// Where something stands: in a file, or in a `--set` argument.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SourceLocation {
    /// In the scenario's text.
    File {
        /// The file, or the name of a built-in scenario.
        name: String,
        /// The line, from 1.
        line: usize,
        /// The column, from 1, counted in characters.
        column: usize,
        /// The line's text.
        text: String,
    },
    /// In an argument of the command line.
    Set {
        /// The argument, `KEY=VALUE`.
        argument: String,
    },
}

impl std::fmt::Display for SourceLocation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            SourceLocation::File {
                name, line, column, ..
            } => write!(f, "{name}:{line}:{column}"),
            SourceLocation::Set { argument } => {
                let shown: String = argument.chars().take(MAX_SHOWN).collect();
                let dots = if shown.len() < argument.len() {
                    "..."
                } else {
                    ""
                };
                write!(f, "--set {shown}{dots}")
            }
        }
    }
}

/// A message of several lines as one.
pub(super) fn one_line(message: &str) -> String {
    message.split_whitespace().collect::<Vec<_>>().join(" ")
}
