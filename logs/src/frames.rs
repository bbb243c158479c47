//! The outermost layer of an MCAP file: records one after the other, each with its opcode and
//! length. Nothing here trusts a length.

use std::path::Path;

use mcap::MAGIC;
use mcap::records::op;

use crate::LogError;
use crate::source::{Attached, Source};

/// The most that one record may have, compressed or not.
pub(crate) const LIMIT_BYTES: u64 = 512 * 1024 * 1024;

/// The bytes in front of each record: opcode and length.
pub(crate) const HEAD_BYTES: u64 = 9;

/// What came next in the file.
pub(crate) enum Frame {
    /// A record; its content is in [`Frames::content`].
    Record { opcode: u8, offset: u64 },
    /// An attachment, of which only the head was read; none if it makes no sense.
    Attachment {
        offset: u64,
        attached: Option<Attached>,
    },
    /// The file is over, as it should be. So many bytes come behind its end, from this one on.
    End { offset: u64, behind: u64 },
    /// The file is over, or makes no sense any more, from this byte on.
    Cut { offset: u64, what: String },
}

/// What is looked at beyond what is needed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Care {
    /// Nothing: attachments are passed over.
    #[default]
    Little,
    /// Attachments are read, for their hashes and checksums.
    Attachments,
    /// The checksums of the data and of the summary too: every byte of the file is read.
    Everything,
}

/// Reads records one after the other.
pub(crate) struct Frames {
    source: Source,
    /// Where the next record starts.
    offset: u64,
    /// Where the content of the last record is.
    content: (u64, u64),
    after_footer: bool,
    care: Care,
    sums: Sums,
}

/// The checksums of all bytes so far: from the start of the file, and from the end of its data.
#[derive(Default)]
struct Sums {
    data: crc32fast::Hasher,
    summary: Option<crc32fast::Hasher>,
    to: u64,
    /// Checksums that do not match, in words.
    wrong: Vec<String>,
}

impl Sums {
    /// Compares a checksum with the one that was counted; a declared one of 0 says nothing.
    fn compare(&mut self, of: &str, declared: u32, counted: u32) {
        if declared != 0 && declared != counted {
            self.wrong.push(format!(
                "the checksum of the {of} does not match: {declared:08x} is declared, {counted:08x} \
                 counted"
            ));
        }
    }
}

impl Frames {
    /// Opens a file and checks its magic bytes.
    pub(crate) fn open(path: &Path, care: Care) -> Result<Self, LogError> {
        Ok(Frames {
            source: Source::open(path)?,
            offset: 8,
            content: (8, 0),
            after_footer: false,
            care,
            sums: Sums::default(),
        })
    }

    /// The size of the file, in bytes.
    pub(crate) fn length(&self) -> u64 {
        self.source.length()
    }

    pub(crate) fn path(&self) -> &Path {
        self.source.path()
    }

    /// The content of the last record.
    pub(crate) fn content(&self) -> &[u8] {
        self.source.held(self.content.0, self.content.1)
    }

    /// Where the next record starts.
    pub(crate) fn offset(&self) -> u64 {
        self.offset
    }

    /// Checksums that were found not to match.
    pub(crate) fn wrong_sums(&mut self) -> Vec<String> {
        std::mem::take(&mut self.sums.wrong)
    }

    /// Goes to the record that starts at `offset`. Sums are no longer counted.
    pub(crate) fn seek(&mut self, offset: u64) {
        self.offset = offset;
        self.after_footer = false;
        self.care = Care::Little;
    }

    /// Hashes an attachment's data and compares its checksum.
    pub(crate) fn sum(&mut self, attached: &mut Attached) -> Result<(), LogError> {
        self.source.sum(attached)
    }

    /// The data of an attachment.
    pub(crate) fn attachment_data(&mut self, attached: &Attached) -> Result<&[u8], LogError> {
        self.source.at(attached.data, attached.data_bytes)
    }

    /// Counts the bytes up to `to` into the checksums.
    fn sum_to(&mut self, to: u64) -> Result<(), LogError> {
        if self.care != Care::Everything {
            return Ok(());
        }
        let Sums {
            data,
            summary,
            to: from,
            ..
        } = &mut self.sums;
        self.source.each(*from, to, |part| {
            match summary {
                Some(summary) => summary.update(part),
                None => data.update(part),
            }
            Ok(())
        })?;
        *from = to;
        Ok(())
    }

    /// Compares the checksum that a record declares with the bytes before it.
    fn check(&mut self, opcode: u8, offset: u64) -> Result<(), LogError> {
        let word = |bytes: &[u8]| bytes.try_into().map(u32::from_le_bytes).unwrap_or(0);
        let content = self.source.at(self.content.0, self.content.1)?;
        match (opcode, content.len()) {
            (op::DATA_END, 4..) => {
                let declared = word(&content[..4]);
                let counted = self.sums.data.clone().finalize();
                self.sums.compare("data", declared, counted);
                self.sum_to(self.offset)?;
                self.sums.summary = Some(crc32fast::Hasher::new());
            }
            (op::FOOTER, 20..) => {
                let declared = word(&content[16..20]);
                let mut sum = self.sums.summary.clone().unwrap_or_default();
                // The footer itself counts, up to its checksum.
                sum.update(self.source.at(offset, HEAD_BYTES + 16)?);
                self.sums.compare("summary", declared, sum.finalize());
            }
            _ => {}
        }
        Ok(())
    }

    /// The next record.
    pub(crate) fn next(&mut self) -> Result<Frame, LogError> {
        let offset = self.offset;
        let remaining = self.length().saturating_sub(offset);
        let cut = |what: String| Ok(Frame::Cut { offset, what });
        if self.after_footer {
            if self.source.at(offset, 8)? != MAGIC {
                return cut("the closing magic bytes are missing".to_owned());
            }
            return Ok(Frame::End {
                offset: offset + 8,
                behind: remaining - 8,
            });
        }
        if remaining == 0 {
            return cut("the file ends without a footer".to_owned());
        }
        self.sum_to(offset)?;
        let head = self.source.at(offset, HEAD_BYTES)?;
        let Some((opcode, length)) = record_head(head) else {
            return cut(format!(
                "{remaining} bytes of a record's head, then the file ends"
            ));
        };
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
        let content = offset + HEAD_BYTES;
        self.offset = content + length;
        self.content = (content, length);
        if opcode == op::ATTACHMENT {
            return self.attachment(offset, length);
        }
        if skipped(opcode) {
            self.content = (content, 0);
            return Ok(Frame::Record { opcode, offset });
        }
        if length > LIMIT_BYTES {
            return Err(LogError::TooLarge {
                path: self.path().to_owned(),
                what: describe(opcode),
                offset,
                actual: length,
                limit: LIMIT_BYTES,
            });
        }
        if (self.source.at(content, length)?.len() as u64) < length {
            return cut("the file ends while it is read".to_owned());
        }
        if self.care == Care::Everything {
            self.check(opcode, offset)?;
        }
        self.after_footer = opcode == op::FOOTER;
        Ok(Frame::Record { opcode, offset })
    }

    fn attachment(&mut self, offset: u64, length: u64) -> Result<Frame, LogError> {
        let (content, _) = self.content;
        let fits = |attached: &Attached| attached.end().is_some_and(|end| end <= content + length);
        let mut attached = self.source.attachment(content, length)?.filter(fits);
        if let Some(attached) = attached.as_mut().filter(|_| self.care != Care::Little) {
            self.source.sum(attached)?;
        }
        Ok(Frame::Attachment { offset, attached })
    }
}

/// Takes the opcode and the length in front of a record apart.
#[inline]
pub(crate) fn record_head(bytes: &[u8]) -> Option<(u8, u64)> {
    let (opcode, length) = bytes.split_first()?;
    let length = length.first_chunk()?;
    Some((*opcode, u64::from_le_bytes(*length)))
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
