//! Files that commands write: never over what the same command reads, nor over what is there and of
//! another kind.

use std::io::Read;
use std::path::{Path, PathBuf};

use farside_logs::refuse_input;

use super::CommandError;

/// What a file is, by how all files of its kind that Farside writes begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    /// A figure: all are alike up to their size.
    Svg,
    /// A report's page: all are alike up to the title.
    Page,
    /// A table with a header: one of its kind starts with the same column.
    Table,
    /// Results of tests in XML: all are alike up to the name.
    Junit,
}

impl Format {
    /// How `text` and all others of its kind begin.
    fn beginning(self, text: &str) -> &str {
        let ends_with = match self {
            Format::Svg => "viewBox=",
            Format::Page => "<title>",
            Format::Table => ",",
            Format::Junit => "name=",
        };
        text.find(ends_with).map_or(text, |end| &text[..end])
    }

    fn name(self) -> &'static str {
        match self {
            Format::Svg => "figure",
            Format::Page => "report",
            Format::Table => "table of this kind",
            Format::Junit => "JUnit file",
        }
    }
}

/// Writes a text, and says where. A page keeps no control characters, for which HTML has no
/// place; figures have none.
///
/// # Errors
/// If the file is one of the inputs by any name, is there and of another kind, or cannot be written.
pub(super) fn write(
    path: PathBuf,
    text: &str,
    format: Format,
    inputs: &[PathBuf],
) -> Result<String, CommandError> {
    refuse_input(&path, inputs)?;
    if is_in_the_way(&path, format.beginning(text)) {
        let what = format.name();
        return Err(CommandError::InTheWay { path, what });
    }
    let is_text = |letter: char| !letter.is_control() || matches!(letter, '\n' | '\t');
    let cleaned: String;
    let text = match format {
        Format::Page if !text.chars().all(is_text) => {
            cleaned = text.chars().filter(|letter| is_text(*letter)).collect();
            &cleaned
        }
        _ => text,
    };
    match std::fs::write(&path, text) {
        Ok(()) => Ok(path.display().to_string()),
        Err(source) => Err(CommandError::Write { path, source }),
    }
}

/// True if there is a file that does not begin like this. Devices and pipes hold nothing that could
/// be lost, nor do empty files.
fn is_in_the_way(path: &Path, beginning: &str) -> bool {
    let there = std::fs::metadata(path).is_ok_and(|found| found.is_file() && found.len() > 0);
    if !there {
        return false;
    }
    let mut found = vec![0; beginning.len()];
    let read = std::fs::File::open(path).and_then(|mut file| file.read_exact(&mut found));
    read.is_err() || found != beginning.as_bytes()
}
