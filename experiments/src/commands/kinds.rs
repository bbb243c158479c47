//! What a file or a name is that a command was given: a scenario, a study, a log or a results
//! folder. What is taken for another thing is called what it is, with the command that takes it.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::CommandError;
use crate::registry::Registry;

/// What files start with that are MCAP.
const MCAP_MAGIC: &[u8] = b"\x89MCAP0\r\n";

/// The most bytes of a file that are looked at.
const MAX_BYTES: u64 = 4 << 20;

/// What commands take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FileKind {
    Scenario,
    Study,
    Log,
    Results,
}

impl FileKind {
    fn name(self) -> &'static str {
        match self {
            FileKind::Scenario => "a scenario",
            FileKind::Study => "a study",
            FileKind::Log => "a log",
            FileKind::Results => "a results folder",
        }
    }

    /// What takes it, for each that is wanted most.
    fn commands(self, given: &str, program: &str) -> String {
        let command = |verb: &str| format!("`{program} {verb} {given}`");
        match self {
            FileKind::Scenario => {
                format!("{} runs it, {} prints it", command("run"), command("check"))
            }
            FileKind::Study => format!("{} runs it", command("study")),
            FileKind::Log => {
                let (info, verify) = (command("info"), command("verify"));
                format!("{info} says what is in it, {verify} runs it again")
            }
            FileKind::Results => format!("{} writes it up", command("report")),
        }
    }
}

/// Refuses what is plainly of another kind than the command takes. What cannot be told goes on, to
/// be read and refused with its place.
///
/// # Errors
/// [`CommandError::OtherKind`].
pub(super) fn expect(
    wanted: FileKind,
    given: &Path,
    registry: &Registry,
) -> Result<(), CommandError> {
    match kind_of(given, registry) {
        Some(found) if found != wanted => {
            let given = given.display().to_string();
            let advice = found.commands(&given, registry.program());
            Err(CommandError::OtherKind {
                given,
                found: found.name(),
                wanted: wanted.name(),
                advice,
            })
        }
        _ => Ok(()),
    }
}

/// What a name or a file is, if that is plain.
fn kind_of(given: &Path, registry: &Registry) -> Option<FileKind> {
    let name = given.to_string_lossy();
    if registry.scenario(&name).is_some() {
        return Some(FileKind::Scenario);
    }
    if registry.study(&name).is_some() {
        return Some(FileKind::Study);
    }
    let found = std::fs::metadata(given).ok()?;
    if found.is_dir() {
        let has_manifest = given.join("manifest.json").is_file();
        return has_manifest.then_some(FileKind::Results);
    }
    // A pipe that nobody writes to would be waited for without end.
    if !found.is_file() || found.len() > MAX_BYTES && !starts_as_log(given) {
        return None;
    }
    if starts_as_log(given) {
        return Some(FileKind::Log);
    }
    let mut text = String::new();
    let file = File::open(given).ok()?;
    file.take(MAX_BYTES).read_to_string(&mut text).ok()?;
    let table = text.parse::<toml::Table>().ok()?;
    let has = |key: &str| table.contains_key(key);
    match (has("system"), has("scenario") || has("factor")) {
        (true, false) => Some(FileKind::Scenario),
        (false, true) => Some(FileKind::Study),
        _ => None,
    }
}

/// Whether a name is that of a log, and of nothing that is built in.
pub(super) fn is_log(given: &Path, registry: &Registry) -> bool {
    kind_of(given, registry) == Some(FileKind::Log)
}

pub(super) fn starts_as_log(path: &Path) -> bool {
    let mut start = [0; MCAP_MAGIC.len()];
    let read = File::open(path).and_then(|mut file| file.read_exact(&mut start));
    read.is_ok() && start == MCAP_MAGIC
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_kind_is_told_from_the_others() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::write(path("log"), b"\x89MCAP0\r\n and more").unwrap();
        std::fs::write(path("scenario"), "system = 'network'").unwrap();
        std::fs::write(path("study"), "scenario = 'x'\n[[factor]]\nname = 'y'").unwrap();
        std::fs::write(path("else"), "neither").unwrap();
        std::fs::create_dir(path("results")).unwrap();
        std::fs::write(path("results/manifest.json"), "{}").unwrap();
        let registry = Registry::builtin();
        let kind = |name: &str| kind_of(&path(name), &registry);
        assert_eq!(kind("log"), Some(FileKind::Log));
        assert_eq!(kind("scenario"), Some(FileKind::Scenario));
        assert_eq!(kind("study"), Some(FileKind::Study));
        assert_eq!(kind("results"), Some(FileKind::Results));
        assert_eq!(kind("else"), None);
        assert_eq!(kind("nothing"), None);
        assert_eq!(kind_of(folder.path(), &registry), None);
        assert_eq!(kind_of(Path::new("/dev/zero"), &registry), None);
        let study = kind_of(Path::new("degradation/loss"), &registry);
        assert_eq!(study, Some(FileKind::Study));
    }
}
