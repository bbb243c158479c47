//! The files that a scenario names: read from disk and kept for the log, or read from the log.

use std::collections::BTreeMap;
use std::io::Read;
use std::path::PathBuf;

/// Reads files by the names that a scenario gives them, and keeps what was read.
///
/// ```
/// use farside_actors::system::Files;
/// let mut files = Files::kept([("map.toml".to_owned(), b"x".to_vec())].into());
/// assert_eq!(files.read("map.toml", 10).unwrap(), b"x");
/// assert!(files.read("other.toml", 10).is_err());
/// ```
#[derive(Clone, Debug)]
pub struct Files {
    /// Where relative names start; `None` reads nothing from disk.
    folder: Option<PathBuf>,
    read: BTreeMap<String, Vec<u8>>,
}

impl Files {
    /// Reads from disk; relative names start at `folder`, that of the scenario.
    pub fn on_disk(folder: PathBuf) -> Self {
        Files {
            folder: Some(folder),
            read: BTreeMap::new(),
        }
    }

    /// Knows these files and no others: those that a log has kept.
    pub fn kept(files: BTreeMap<String, Vec<u8>>) -> Self {
        Files {
            folder: None,
            read: files,
        }
    }

    /// The content of the file called `name`, of at most `limit_bytes`.
    ///
    /// # Errors
    /// With a message that starts with the file's name.
    pub fn read(&mut self, name: &str, limit_bytes: u64) -> Result<Vec<u8>, String> {
        if let Some(bytes) = self.read.get(name) {
            return Ok(bytes.clone());
        }
        let Some(folder) = &self.folder else {
            return Err(format!("{name}: the log does not hold this file"));
        };
        let path = folder.join(name);
        let failed = |error| format!("{}: cannot read it: {error}", path.display());
        if !std::fs::metadata(&path).map_err(failed)?.is_file() {
            return Err(failed(no_file()));
        }
        let file = std::fs::File::open(&path).map_err(failed)?;
        let mut bytes = Vec::new();
        let reading = file.take(limit_bytes + 1).read_to_end(&mut bytes);
        reading.map_err(failed)?;
        if bytes.len() as u64 > limit_bytes {
            return Err(format!(
                "{}: larger than {limit_bytes} bytes, the most that is read",
                path.display()
            ));
        }
        self.read.insert(name.to_owned(), bytes.clone());
        Ok(bytes)
    }

    /// Where what was read lies on disk; nothing if it came out of a log.
    pub fn paths(&self) -> Vec<PathBuf> {
        let names = self.read.keys();
        let folder = self.folder.iter();
        folder
            .flat_map(|folder| names.clone().map(|name| folder.join(name)))
            .collect()
    }

    /// What was read, by name.
    pub fn all(&self) -> &BTreeMap<String, Vec<u8>> {
        &self.read
    }
}

/// Why something that is there is not read.
pub fn no_file() -> std::io::Error {
    let kind = std::io::ErrorKind::InvalidInput;
    std::io::Error::new(kind, "it is no regular file")
}
