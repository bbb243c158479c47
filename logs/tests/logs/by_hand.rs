//! MCAP files that are written record by record, to be wrong in one place.

use std::fs;
use std::path::{Path, PathBuf};

use mcap::records::op;

/// An MCAP file, written record by record.
#[derive(Clone, Default)]
pub(crate) struct File(pub(crate) Vec<u8>);

pub(crate) fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat()
}

pub(crate) fn record(opcode: u8, content: &[u8]) -> Vec<u8> {
    [
        &[opcode][..],
        &(content.len() as u64).to_le_bytes(),
        content,
    ]
    .concat()
}

pub(crate) fn schema(id: u16, name: &str, encoding: &str, data: &[u8]) -> Vec<u8> {
    let length = (data.len() as u32).to_le_bytes();
    let head = [&id.to_le_bytes()[..], &text(name), &text(encoding)].concat();
    record(op::SCHEMA, &[&head[..], &length, data].concat())
}

pub(crate) fn channel(id: u16, schema: u16, topic: &str, encoding: &str) -> Vec<u8> {
    let ids = [id.to_le_bytes(), schema.to_le_bytes()].concat();
    record(
        op::CHANNEL,
        &[&ids[..], &text(topic), &text(encoding), &[0; 4]].concat(),
    )
}

pub(crate) fn message(channel: u16, time: u64, data: &[u8]) -> Vec<u8> {
    let times = [time.to_le_bytes(), time.to_le_bytes()].concat();
    record(
        op::MESSAGE,
        &[&channel.to_le_bytes()[..], &[0; 4], &times, data].concat(),
    )
}

pub(crate) fn attachment(name: &str, data: &[u8]) -> Vec<u8> {
    let length = (data.len() as u64).to_le_bytes();
    let content = [&[0; 16][..], &text(name), &text(""), &length, data].concat();
    let sum = crc32fast::hash(&content).to_le_bytes();
    record(op::ATTACHMENT, &[&content[..], &sum].concat())
}

pub(crate) fn metadata(name: &str, key: &str, value: &str) -> Vec<u8> {
    let map = [text(key), text(value)].concat();
    let length = (map.len() as u32).to_le_bytes();
    record(op::METADATA, &[&text(name)[..], &length, &map].concat())
}

pub(crate) fn chunk(compression: &str, records: &[u8]) -> Vec<u8> {
    let data = match compression {
        "zstd" => zstd::bulk::compress(records, 1).unwrap(),
        "lz4" => {
            let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
            std::io::Write::write_all(&mut encoder, records).unwrap();
            encoder.finish().unwrap()
        }
        _ => records.to_vec(),
    };
    let sizes = [&[0; 16][..], &(records.len() as u64).to_le_bytes()].concat();
    let sum = crc32fast::hash(records).to_le_bytes();
    let length = (data.len() as u64).to_le_bytes();
    record(
        op::CHUNK,
        &[&sizes[..], &sum, &text(compression), &length, &data].concat(),
    )
}

impl File {
    pub(crate) fn new() -> File {
        let header = record(op::HEADER, &[text(""), text("hand")].concat());
        File([mcap::MAGIC, &header].concat())
    }

    pub(crate) fn with(mut self, record: impl AsRef<[u8]>) -> File {
        self.0.extend_from_slice(record.as_ref());
        self
    }

    pub(crate) fn end(self) -> File {
        let end = [record(op::DATA_END, &[0; 4]), record(op::FOOTER, &[0; 20])].concat();
        self.with(end).with(mcap::MAGIC)
    }

    pub(crate) fn write(&self, folder: &Path, name: &str) -> PathBuf {
        let path = folder.join(name);
        fs::write(&path, &self.0).unwrap();
        path
    }
}
