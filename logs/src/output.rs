//! What may be written where: no command writes over a file that it reads, and a log takes the place
//! of another log only.

use std::fs::{File, Metadata, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

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

/// The lock of a file that is to be replaced by another one, if there is a file: nobody is writing it, and
/// nobody begins to as long as the lock is kept.
///
/// # Errors
/// [`LogError::Busy`], or if it cannot be opened.
pub(crate) fn lock_replaced(path: &Path) -> Result<Option<File>, LogError> {
    let file = match File::options().append(true).open(path) {
        Ok(file) => file,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(LogError::io(path, "create", error)),
    };
    lock(&file, path)?;
    Ok(Some(file))
}

/// Locks a file to be written. A process that starts another one shares its open files with it for a
/// moment, and with them the lock of a file that it has closed: what is locked then is free soon.
///
/// # Errors
/// [`LogError::Busy`], or if it cannot be locked. Some file systems know no locks, which is no error.
pub(crate) fn lock(file: &File, path: &Path) -> Result<(), LogError> {
    let mut locked = file.try_lock();
    for _ in 0..PATIENCE {
        if !matches!(locked, Err(TryLockError::WouldBlock)) {
            break;
        }
        std::thread::sleep(Duration::from_millis(10));
        locked = file.try_lock();
    }
    match locked {
        Ok(()) => Ok(()),
        Err(TryLockError::WouldBlock) => Err(LogError::Busy {
            path: path.to_owned(),
        }),
        Err(TryLockError::Error(error)) if error.kind() == io::ErrorKind::Unsupported => Ok(()),
        Err(TryLockError::Error(error)) => Err(LogError::io(path, "lock", error)),
    }
}

/// How often a lock is tried again.
const PATIENCE: u32 = 50;

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
