//! The content of MCAP records, parsed without trusting a length.
//!
//! `mcap::parse_record` reads the same, but of whole files from friends only: in mcap 0.26 it
//! panics on an attachment without a checksum, and reserves as many bytes as a text says that it
//! has. Its readers do not say where in a file a record is, nor go on behind a broken one.
//! `tests/logs/hostile.rs` shows what can be shown, and fails once it is no longer so.

use std::collections::BTreeMap;

use mcap::records::MessageHeader;

/// Takes little-endian fields off the front of a record.
pub(crate) struct Parser<'a> {
    rest: &'a [u8],
}

impl<'a> Parser<'a> {
    pub(crate) fn new(content: &'a [u8]) -> Self {
        Parser { rest: content }
    }

    pub(crate) fn rest(self) -> &'a [u8] {
        self.rest
    }

    #[inline]
    pub(crate) fn bytes(&mut self, length: u64) -> Option<&'a [u8]> {
        let length = usize::try_from(length).ok()?;
        let (taken, rest) = self.rest.split_at_checked(length)?;
        self.rest = rest;
        Some(taken)
    }

    #[inline]
    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (taken, rest) = self.rest.split_first_chunk::<N>()?;
        self.rest = rest;
        Some(*taken)
    }

    #[inline]
    pub(crate) fn u8(&mut self) -> Option<u8> {
        self.array::<1>().map(|[byte]| byte)
    }

    #[inline]
    pub(crate) fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    #[inline]
    pub(crate) fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    #[inline]
    pub(crate) fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    pub(crate) fn text(&mut self) -> Option<&'a str> {
        let length = self.u32()?;
        std::str::from_utf8(self.bytes(u64::from(length))?).ok()
    }

    pub(crate) fn map(&mut self) -> Option<BTreeMap<String, String>> {
        let length = self.u32()?;
        let mut inner = Parser::new(self.bytes(u64::from(length))?);
        let mut map = BTreeMap::new();
        while !inner.rest.is_empty() {
            map.insert(inner.text()?.to_owned(), inner.text()?.to_owned());
        }
        Some(map)
    }
}

/// A schema record.
pub(crate) struct SchemaRecord<'a> {
    pub(crate) id: u16,
    pub(crate) name: &'a str,
    pub(crate) encoding: &'a str,
    pub(crate) data: &'a [u8],
}

impl<'a> SchemaRecord<'a> {
    pub(crate) fn parse(content: &'a [u8]) -> Option<Self> {
        let mut parser = Parser::new(content);
        Some(SchemaRecord {
            id: parser.u16()?,
            name: parser.text()?,
            encoding: parser.text()?,
            data: {
                let length = parser.u32()?;
                parser.bytes(u64::from(length))?
            },
        })
    }
}

/// A channel record.
pub(crate) struct ChannelRecord<'a> {
    pub(crate) id: u16,
    pub(crate) schema_id: u16,
    pub(crate) topic: &'a str,
    pub(crate) encoding: &'a str,
    pub(crate) metadata: BTreeMap<String, String>,
}

impl<'a> ChannelRecord<'a> {
    pub(crate) fn parse(content: &'a [u8]) -> Option<Self> {
        let mut parser = Parser::new(content);
        Some(ChannelRecord {
            id: parser.u16()?,
            schema_id: parser.u16()?,
            topic: parser.text()?,
            encoding: parser.text()?,
            metadata: parser.map()?,
        })
    }
}

/// The bytes of a message record in front of its data.
pub(crate) const MESSAGE_HEADER_BYTES: usize = 22;

/// Takes the head of a message record apart.
#[inline]
pub(crate) fn message_header(content: &[u8]) -> Option<MessageHeader> {
    let mut parser = Parser::new(content);
    Some(MessageHeader {
        channel_id: parser.u16()?,
        sequence: parser.u32()?,
        log_time: parser.u64()?,
        publish_time: parser.u64()?,
    })
}

/// Takes a metadata record apart: its name and its entries.
pub(crate) fn metadata(content: &[u8]) -> Option<(String, BTreeMap<String, String>)> {
    let mut parser = Parser::new(content);
    Some((parser.text()?.to_owned(), parser.map()?))
}

/// The most that so many compressed bytes may unpack to: what is more is no log, but made to keep
/// its readers busy.
pub(crate) fn most(compressed: u64) -> u64 {
    compressed.saturating_mul(1000).max(64 << 20)
}

/// A chunk record, still compressed.
pub(crate) struct ChunkRecord<'a> {
    pub(crate) size: u64,
    pub(crate) sum: u32,
    pub(crate) compression: &'a str,
    pub(crate) data: &'a [u8],
}

impl<'a> ChunkRecord<'a> {
    pub(crate) fn parse(content: &'a [u8]) -> Option<Self> {
        let mut parser = Parser::new(content);
        // The times of the first and last message: what is in the chunk says it better.
        parser.u64()?;
        parser.u64()?;
        Some(ChunkRecord {
            size: parser.u64()?,
            sum: parser.u32()?,
            compression: parser.text()?,
            data: {
                let length = parser.u64()?;
                parser.bytes(length)?
            },
        })
    }

    /// Decompresses the chunk into `out` and checks it; `Err` says what is wrong.
    pub(crate) fn decompress(&self, limit: u64, out: &mut Vec<u8>) -> Result<(), String> {
        use std::io::Read;
        out.clear();
        let limit = limit.min(most(self.data.len() as u64));
        if self.size > limit {
            return Err(format!(
                "a chunk of {} bytes that unpacks to {}, more than the {limit} allowed",
                self.data.len(),
                self.size
            ));
        }
        let size = self.size as usize;
        match self.compression {
            "" => out.extend_from_slice(self.data),
            "zstd" => {
                // Reserved, not touched: a size that lies costs no memory.
                out.reserve(size);
                let done = zstd::bulk::Decompressor::new()
                    .and_then(|mut zstd| zstd.decompress_to_buffer(self.data, out));
                done.map_err(|error| format!("a chunk that does not decompress: {error}"))?;
            }
            "lz4" => {
                let decoder = lz4_flex::frame::FrameDecoder::new(self.data);
                let done = decoder.take(self.size.saturating_add(1)).read_to_end(out);
                done.map_err(|error| format!("a chunk that does not decompress: {error}"))?;
            }
            other => {
                return Err(format!(
                    "a chunk compressed as {other:?}, not as zstd or lz4"
                ));
            }
        }
        if out.len() != size {
            return Err(format!(
                "a chunk of {} bytes that declares {size}",
                out.len()
            ));
        }
        if self.sum != 0 && crc32fast::hash(out) != self.sum {
            return Err("a chunk whose checksum does not match".to_owned());
        }
        Ok(())
    }
}
