//! Files of scenarios and studies: their text, and how they are called.

use std::path::Path;

use farside_actors::system::no_file;

use super::ScenarioError;

/// The most bytes of a scenario or study that are read.
const MAX_BYTES: u64 = 4 << 20;

pub(crate) fn stem(name: &str) -> String {
    let stem = Path::new(name).file_stem();
    stem.map_or_else(|| name.to_owned(), |stem| stem.to_string_lossy().into())
}

/// Reads the text of a scenario or study.
pub(crate) fn read(
    path: &Path,
    missing: impl FnOnce() -> ScenarioError,
) -> Result<String, ScenarioError> {
    let io = |source| ScenarioError::Io {
        path: path.to_owned(),
        source,
    };
    let size = match std::fs::metadata(path) {
        Ok(metadata) if metadata.is_dir() => {
            return Err(io(std::io::ErrorKind::IsADirectory.into()));
        }
        // A pipe that nobody writes to would be waited for without end.
        Ok(metadata) if !metadata.is_file() => return Err(io(no_file())),
        Ok(metadata) => metadata.len(),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            return Err(missing());
        }
        Err(error) => return Err(io(error)),
    };
    if size > MAX_BYTES {
        return Err(ScenarioError::TooLarge {
            path: path.to_owned(),
            actual_bytes: size,
            limit_bytes: MAX_BYTES,
        });
    }
    // It may have grown.
    use std::io::Read as _;
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path).map_err(io)?;
    file.take(MAX_BYTES).read_to_end(&mut bytes).map_err(io)?;
    String::from_utf8(bytes).map_err(|error| ScenarioError::NotUtf8 {
        path: path.to_owned(),
        at_byte: error.utf8_error().valid_up_to(),
    })
}
