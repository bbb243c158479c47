//! The outermost layer of an MCAP file: records one after the other, each with its opcode and
//! length. Nothing here trusts a length.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use mcap::MAGIC;
use mcap::records::op;

use crate::LogError;

/// The most that one record may have, compressed or not.
pub(crate) const LIMIT_BYTES: u64 = 512 * 1024 * 1024;

/// The bytes in front of each record: opcode and length.
const HEAD_BYTES: u64 = 9;

/// What came next in the file.
pub(crate) enum Frame {
    /// A record; its content is in [`Frames::content`].
    Record { opcode: u8, offset: u64 },
    /// The file is over, as it should be.
    End,
    /// The file is over, or makes no sense any more, from this byte on.
    Cut { offset: u64, what: String },
}

/// Reads records one after the other.
pub(crate) struct Frames {
    path: PathBuf,
    file: BufReader<File>,
    /// Where the next record starts.
    offset: u64,
    length: u64,
    content: Vec<u8>,
    after_footer: bool,
}

impl Frames {
    /// Opens a file and checks its magic bytes.
    pub(crate) fn open(path: &Path) -> Result<Self, LogError> {
        let mut file = File::open(path).map_err(|error| LogError::io(path, "open", error))?;
        let io = |error| LogError::io(path, "read", error);
        let metadata = file.metadata().map_err(io)?;
        if metadata.is_dir() {
            let error = std::io::Error::from(std::io::ErrorKind::IsADirectory);
            return Err(LogError::io(path, "read", error));
        }
        let mut magic = Vec::new();
        (&mut file).take(8).read_to_end(&mut magic).map_err(io)?;
        if magic != MAGIC {
            return Err(LogError::NotMcap {
                path: path.to_owned(),
                expected: hex(MAGIC),
                actual: match magic.len() {
                    0 => "is empty".to_owned(),
                    length if length < MAGIC.len() => format!("has only {length} bytes"),
                    _ => format!("starts with {}", hex(&magic)),
                },
            });
        }
        Ok(Frames {
            path: path.to_owned(),
            file: BufReader::with_capacity(64 * 1024, file),
            offset: 8,
            length: metadata.len(),
            content: Vec::new(),
            after_footer: false,
        })
    }

    /// The size of the file, in bytes.
    pub(crate) fn length(&self) -> u64 {
        self.length
    }

    /// The content of the last record.
    pub(crate) fn content(&self) -> &[u8] {
        &self.content
    }

    /// Where the next record starts.
    pub(crate) fn offset(&self) -> u64 {
        self.offset
    }

    /// Goes to the record that starts at `offset`.
    pub(crate) fn seek(&mut self, offset: u64) -> Result<(), LogError> {
        let moved = self.file.seek(SeekFrom::Start(offset));
        moved.map_err(|error| LogError::io(&self.path, "read", error))?;
        self.offset = offset;
        self.after_footer = false;
        Ok(())
    }

    fn read(&mut self, length: u64) -> Result<bool, LogError> {
        self.content.clear();
        let read = (&mut self.file).take(length).read_to_end(&mut self.content);
        let read = read.map_err(|error| LogError::io(&self.path, "read", error))?;
        // A file that shrinks while it is read is cut, like any other.
        Ok(read as u64 == length)
    }

    /// The next record.
    pub(crate) fn next(&mut self) -> Result<Frame, LogError> {
        let offset = self.offset;
        let remaining = self.length.saturating_sub(offset);
        let cut = |what: String| Ok(Frame::Cut { offset, what });
        if self.after_footer {
            let whole = self.read(8)? && self.content == MAGIC;
            return match whole {
                true => Ok(Frame::End),
                false => cut("the closing magic bytes are missing".to_owned()),
            };
        }
        if remaining == 0 {
            return cut("the file ends without a footer".to_owned());
        }
        if remaining < HEAD_BYTES || !self.read(HEAD_BYTES)? {
            return cut(format!(
                "{remaining} bytes of a record's head, then the file ends"
            ));
        }
        let opcode = self.content[0];
        let mut length = [0; 8];
        length.copy_from_slice(&self.content[1..9]);
        let length = u64::from_le_bytes(length);
        if opcode == 0 {
            return cut("opcode 0, which no record has".to_owned());
        }
        let available = remaining - HEAD_BYTES;
        if length > available {
            let what = describe(opcode);
            return cut(format!(
                "{what} of {length} bytes, of which {available} are there"
            ));
        }
        self.offset = offset + HEAD_BYTES + length;
        if skipped(opcode) {
            self.content.clear();
            let next = self.offset;
            self.seek_relative(length)?;
            self.offset = next;
            return Ok(Frame::Record { opcode, offset });
        }
        if length > LIMIT_BYTES {
            return Err(LogError::TooLarge {
                path: self.path.clone(),
                what: describe(opcode),
                offset,
                actual: length,
                limit: LIMIT_BYTES,
            });
        }
        if !self.read(length)? {
            return cut("the file ends while it is read".to_owned());
        }
        self.after_footer = opcode == op::FOOTER;
        Ok(Frame::Record { opcode, offset })
    }

    fn seek_relative(&mut self, length: u64) -> Result<(), LogError> {
        let length = i64::try_from(length).unwrap_or(i64::MAX);
        let moved = self.file.seek_relative(length);
        moved.map_err(|error| LogError::io(&self.path, "read", error))
    }

    /// The first offset from `from` on where a whole chunk seems to start, to go on behind damage.
    pub(crate) fn find_chunk(&mut self, from: u64) -> Result<Option<u64>, LogError> {
        const WINDOW: usize = 1 << 20;
        let mut at = from;
        while at + HEAD_BYTES < self.length {
            self.seek(at)?;
            let length = (self.length - at).min(WINDOW as u64 + 64);
            if !self.read(length)? {
                return Ok(None);
            }
            for start in 0..self.content.len().min(WINDOW) {
                let offset = at + start as u64;
                if looks_like_chunk(&self.content[start..], self.length - offset) {
                    return Ok(Some(offset));
                }
            }
            at += WINDOW as u64;
        }
        Ok(None)
    }
}

/// True if a chunk record that fits into `available` bytes seems to start here.
fn looks_like_chunk(bytes: &[u8], available: u64) -> bool {
    if bytes.first() != Some(&op::CHUNK) {
        return false;
    }
    let number = |at: usize| {
        let word = bytes.get(at..at + 8)?;
        Some(u64::from_le_bytes(word.try_into().ok()?))
    };
    let Some(length) = number(1) else {
        return false;
    };
    let Some(name) = bytes.get(37..41) else {
        return false;
    };
    let name = u32::from_le_bytes([name[0], name[1], name[2], name[3]]) as usize;
    let known = matches!(
        bytes.get(41..41 + name.min(8)),
        Some(b"" | b"lz4" | b"zstd")
    );
    let Some(size) = number(41 + name.min(8)) else {
        return false;
    };
    // Head of the chunk: two times, two sizes, a checksum, the compression's name.
    known && length <= available - HEAD_BYTES && size.checked_add(40 + name as u64) == Some(length)
}

/// Records of which nothing is needed: indices, and whatever a later version of MCAP may add.
fn skipped(opcode: u8) -> bool {
    !matches!(
        opcode,
        op::HEADER
            | op::FOOTER
            | op::SCHEMA
            | op::CHANNEL
            | op::MESSAGE
            | op::CHUNK
            | op::ATTACHMENT
            | op::METADATA
            | op::DATA_END
    )
}

pub(crate) fn describe(opcode: u8) -> &'static str {
    match opcode {
        op::HEADER => "header",
        op::FOOTER => "footer",
        op::SCHEMA => "schema",
        op::CHANNEL => "channel",
        op::MESSAGE => "message",
        op::CHUNK => "chunk",
        op::MESSAGE_INDEX => "message index",
        op::ATTACHMENT => "attachment",
        op::METADATA => "metadata record",
        op::DATA_END => "end of data",
        _ => "record",
    }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
