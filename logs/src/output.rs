//! What may be written where: no command writes over a file that it reads, and a log takes the place
//! of another log only.

use std::fs::Metadata;
use std::path::{Path, PathBuf};

use crate::error::LogError;
use crate::source::Source;

/// Refuses an output that is one of the inputs, by whatever name: path, link or case.
///
/// ```
/// use farside_logs::refuse_input;
/// let folder = tempfile::tempdir()?;
/// let (scenario, other) = (folder.path().join("s.toml"), folder.path().join("t.toml"));
/// std::fs::write(&scenario, "system = 'network'")?;
/// std::fs::hard_link(&scenario, &other)?;
/// assert!(refuse_input(&other, &[scenario.clone()]).is_err());
/// assert!(refuse_input(&folder.path().join("run.mcap"), &[scenario]).is_ok());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`LogError::SameFile`].
pub fn refuse_input(out: &Path, inputs: &[PathBuf]) -> Result<(), LogError> {
    let Ok(found) = std::fs::metadata(out) else {
        return Ok(());
    };
    let one_by_path = |input: &PathBuf| match (input.canonicalize(), out.canonicalize()) {
        (Ok(from), Ok(to)) => from == to,
        _ => false,
    };
    match inputs
        .iter()
        .any(|input| one_by_path(input) || is_same_file(input, &found))
    {
        true => Err(LogError::SameFile {
            path: out.to_owned(),
        }),
        false => Ok(()),
    }
}

/// Refuses to write a log over an input, or over what is there and no log. Devices and pipes hold
/// nothing that could be lost.
///
/// # Errors
/// [`LogError::SameFile`] or [`LogError::InTheWay`].
pub fn may_hold_log(out: &Path, inputs: &[PathBuf]) -> Result<(), LogError> {
    refuse_input(out, inputs)?;
    let in_the_way = std::fs::metadata(out)
        .is_ok_and(|found| found.is_file() && found.len() > 0 && Source::open(out).is_err());
    match in_the_way {
        true => Err(LogError::InTheWay {
            path: out.to_owned(),
        }),
        false => Ok(()),
    }
}

/// True if the two are one file by two names, as with hard links.
#[cfg(unix)]
fn is_same_file(one: &Path, other: &Metadata) -> bool {
    use std::os::unix::fs::MetadataExt;
    let one = std::fs::metadata(one);
    one.is_ok_and(|one| (one.dev(), one.ino()) == (other.dev(), other.ino()))
}

#[cfg(not(unix))]
fn is_same_file(_one: &Path, _other: &Metadata) -> bool {
    false
}
