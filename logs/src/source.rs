//! A file of which only a window is held: bytes at any place, attachments passed over by their
//! length.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use mcap::MAGIC;
use xxhash_rust::xxh3::Xxh3;

use crate::LogError;
use crate::parse::Parser;

/// How much of a file is read at a time, in bytes.
const WINDOW_BYTES: u64 = 1 << 20;

/// The most that the name or the media type of an attachment may have, in bytes.
const TEXT_LIMIT: u64 = 1 << 16;

/// A file that is read through a window.
pub(crate) struct Source {
    path: PathBuf,
    file: File,
    length: u64,
    window: Vec<u8>,
    /// Where in the file the window starts.
    start: u64,
}

impl Source {
    /// Opens a file that starts as MCAP files do.
    pub(crate) fn open(path: &Path) -> Result<Source, LogError> {
        let found = std::fs::metadata(path).map_err(|error| LogError::io(path, "open", error))?;
        if found.is_dir() {
            let error = std::io::Error::from(std::io::ErrorKind::IsADirectory);
            return Err(LogError::io(path, "read", error));
        }
        // A pipe can be read once, and a log is read in several places; opening one may also wait
        // for ever.
        if !found.is_file() {
            return Err(LogError::NotAFile {
                path: path.to_owned(),
            });
        }
        let file = File::open(path).map_err(|error| LogError::io(path, "open", error))?;
        let mut source = Source {
            path: path.to_owned(),
            length: found.len(),
            file,
            window: Vec::new(),
            start: 0,
        };
        let first = source.at(0, 512)?;
        if !first.starts_with(MAGIC) {
            return Err(LogError::NotMcap {
                path: path.to_owned(),
                expected: crate::shown::hex(MAGIC),
                actual: what_it_is(first),
            });
        }
        Ok(source)
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// The size of the file, in bytes.
    pub(crate) fn length(&self) -> u64 {
        self.length
    }

    /// The bytes from `offset` on, as many as asked for or as there are.
    pub(crate) fn at(&mut self, offset: u64, bytes: u64) -> Result<&[u8], LogError> {
        let bytes = bytes.min(self.length.saturating_sub(offset));
        let held = self.start + self.window.len() as u64;
        if offset < self.start || offset + bytes > held {
            // Some more, so that what comes next does not move the window again.
            self.load(offset, bytes + WINDOW_BYTES)?;
        }
        Ok(self.held(offset, bytes))
    }

    /// The bytes from `offset` on that are in the window, at most as many as asked for.
    pub(crate) fn held(&self, offset: u64, bytes: u64) -> &[u8] {
        let from = offset.checked_sub(self.start).unwrap_or(u64::MAX);
        let from = usize::try_from(from).unwrap_or(usize::MAX);
        // A file that shrinks while it is read is cut, like any other.
        let there = self.window.get(from..).unwrap_or_default();
        &there[..there.len().min(bytes as usize)]
    }

    /// Moves the window; what it held already is not read again.
    fn load(&mut self, offset: u64, bytes: u64) -> Result<(), LogError> {
        let held = self.start + self.window.len() as u64;
        if offset >= self.start && offset < held {
            self.window.drain(..(offset - self.start) as usize);
        } else {
            self.window.clear();
        }
        self.start = offset;
        let next = offset + self.window.len() as u64;
        let more = (offset + bytes).saturating_sub(next);
        let io = |error| LogError::io(&self.path, "read", error);
        self.file.seek(SeekFrom::Start(next)).map_err(io)?;
        let mut rest = (&mut self.file).take(more);
        rest.read_to_end(&mut self.window).map_err(io)?;
        // What one large record needed is not kept for the small ones behind it.
        if self.window.capacity() as u64 > 8 * bytes.max(WINDOW_BYTES) {
            self.window.shrink_to(bytes as usize);
        }
        Ok(())
    }

    /// Calls `each` with the bytes from `from` to `to`, part by part.
    pub(crate) fn each(
        &mut self,
        from: u64,
        to: u64,
        mut each: impl FnMut(&[u8]) -> Result<(), LogError>,
    ) -> Result<(), LogError> {
        let mut at = from;
        while at < to {
            let part = self.at(at, (to - at).min(WINDOW_BYTES))?;
            if part.is_empty() {
                break;
            }
            each(part)?;
            at += part.len() as u64;
        }
        Ok(())
    }

    /// The head of the attachment whose content starts at `content` and has `length` bytes; `None`
    /// if it is malformed. Its data is passed over.
    pub(crate) fn attachment(
        &mut self,
        content: u64,
        length: u64,
    ) -> Result<Option<Attached>, LogError> {
        let bytes = self.at(content, length.min(2 * TEXT_LIMIT + 64))?;
        let mut parser = Parser::new(bytes);
        let mut read = || {
            let (log_time, create_time) = (parser.u64()?, parser.u64()?);
            let (name, media_type) = (parser.text()?.to_owned(), parser.text()?.to_owned());
            let data_bytes = parser.u64()?;
            Some((log_time, create_time, name, media_type, data_bytes))
        };
        let Some((log_time, create_time, name, media_type, data_bytes)) = read() else {
            return Ok(None);
        };
        let head = (bytes.len() - parser.rest().len()) as u64;
        Ok(Some(Attached {
            log_time,
            create_time,
            name,
            media_type,
            content,
            data: content + head,
            data_bytes,
            sum: Sum::NotLookedAt,
        }))
    }

    /// Hashes an attachment's data and compares its checksum.
    pub(crate) fn sum(&mut self, attached: &mut Attached) -> Result<(), LogError> {
        let end = attached.data.saturating_add(attached.data_bytes);
        let mut sum = crc32fast::Hasher::new();
        self.each(attached.content, attached.data, |part| {
            sum.update(part);
            Ok(())
        })?;
        let mut hash = Xxh3::new();
        self.each(attached.data, end, |part| {
            sum.update(part);
            hash.update(part);
            Ok(())
        })?;
        let declared = self.at(end, 4)?;
        let declared = declared.try_into().map(u32::from_le_bytes).unwrap_or(0);
        attached.sum = match declared == 0 || declared == sum.finalize() {
            true => Sum::Matches(hash.digest()),
            false => Sum::Differs(hash.digest()),
        };
        Ok(())
    }
}

/// An attachment, of which only the head is held.
#[derive(Clone, Debug)]
pub(crate) struct Attached {
    pub(crate) log_time: u64,
    pub(crate) create_time: u64,
    pub(crate) name: String,
    pub(crate) media_type: String,
    /// Where its record's content starts.
    pub(crate) content: u64,
    /// Where its data starts.
    pub(crate) data: u64,
    pub(crate) data_bytes: u64,
    pub(crate) sum: Sum,
}

impl Attached {
    /// Where its record ends if it is what its head says: behind data and checksum.
    pub(crate) fn end(&self) -> Option<u64> {
        self.data.checked_add(self.data_bytes)?.checked_add(4)
    }
}

/// Whether an attachment is as it was written: with a hash of its data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sum {
    NotLookedAt,
    Matches(u64),
    Differs(u64),
}

/// What a file is that starts with these bytes, in words that follow "it".
pub(crate) fn what_it_is(first: &[u8]) -> String {
    const KNOWN: [(&[u8], &str); 18] = [
        (
            b"version https://git-lfs",
            "is a Git LFS pointer: `git lfs pull` fetches the file itself",
        ),
        (
            b"#ROSBAG V",
            "is a ROS 1 bag: `mcap convert` makes an MCAP file of it",
        ),
        (
            b"SQLite format 3\0",
            "is an SQLite database, perhaps a ROS 2 bag: `ros2 bag convert` makes MCAP of it",
        ),
        (b"\x1f\x8b", "is compressed with gzip: `gunzip` unpacks it"),
        (
            b"\x28\xb5\x2f\xfd",
            "is compressed with zstd: `unzstd` unpacks it",
        ),
        (
            b"\x04\x22\x4d\x18",
            "is compressed with lz4: `unlz4` unpacks it",
        ),
        (b"BZh", "is compressed with bzip2: `bunzip2` unpacks it"),
        (b"\xfd7zXZ\0", "is compressed with xz: `unxz` unpacks it"),
        (b"PK\x03\x04", "is a ZIP archive: `unzip` unpacks it"),
        (b"ULog\x01\x12\x35", "is a PX4 ULog file"),
        (b"\x89HDF\r\n", "is an HDF5 file"),
        (b"\x89PNG\r\n", "is a PNG picture"),
        (b"PAR1", "is a Parquet file"),
        (b"%YAML", "is YAML, perhaps the metadata of a ROS 2 bag"),
        (
            b"rosbag2_bagfile_information",
            "is the metadata of a ROS 2 bag, which names its MCAP files",
        ),
        (
            b"\x89MCAP0\n",
            "is an MCAP file whose line ends were changed, as by a transfer as text",
        ),
        (b"\x89MCAP", "is an MCAP file of another version"),
        (
            b"<",
            "is HTML or XML, perhaps an error page instead of the file",
        ),
    ];
    if first.is_empty() {
        return "is empty".to_owned();
    }
    if first.len() < MAGIC.len() && MAGIC.starts_with(first) {
        return format!("has only {} bytes", first.len());
    }
    if let Some((_, what)) = KNOWN.iter().find(|(start, _)| first.starts_with(start)) {
        return (*what).to_owned();
    }
    if first.get(257..262) == Some(b"ustar") {
        return "is a tar archive: `tar -x` unpacks it".to_owned();
    }
    if first.iter().all(|byte| *byte == 0) {
        return "starts with nothing but zeros, as a file whose blocks were never written"
            .to_owned();
    }
    let start = &first[..first.len().min(MAGIC.len())];
    format!("starts with {}", crate::shown::hex(start))
}

#[cfg(test)]
mod tests {
    use super::what_it_is;

    #[test]
    fn other_files_are_called_by_their_names() {
        for (start, word) in [
            (
                &b"version https://git-lfs.github.com/spec/v1\n"[..],
                "Git LFS",
            ),
            (b"#ROSBAG V2.0\n", "ROS 1 bag"),
            (b"SQLite format 3\0....", "SQLite"),
            (b"\x1f\x8b\x08", "gzip"),
            (b"\x89MCAP1\r\n", "another version"),
            (b"\x89MCAP", "only 5 bytes"),
            (b"", "empty"),
            (b"hello, world", "68656c6c6f2c2077"),
            (&[0; 512], "zeros"),
        ] {
            assert!(what_it_is(start).contains(word), "{}", what_it_is(start));
        }
    }
}
