//! Files that are wrong in every way: a clear error or a result, never a panic.

use std::collections::BTreeMap;
use std::fs;
use std::sync::OnceLock;

use farside_logs::{Compression, DiffOptions, Log, LogOptions, diff, info, recover};
use proptest::prelude::*;

use crate::common::{Plan, log_to, logged, options};

fn small_log() -> &'static [u8] {
    static LOG: OnceLock<Vec<u8>> = OnceLock::new();
    LOG.get_or_init(|| {
        let (_folder, path, _) = logged(&Plan {
            rovers: 2,
            cycles: 6,
            ..Plan::default()
        });
        fs::read(path).unwrap()
    })
}

/// Reads the bytes in every way that there is.
fn read_all(bytes: &[u8]) {
    let folder = tempfile::tempdir().unwrap();
    let (good, bad) = (folder.path().join("good"), folder.path().join("bad"));
    let out = folder.path().join("out");
    fs::write(&good, small_log()).unwrap();
    fs::write(&bad, bytes).unwrap();
    let told = info(&bad);
    if let Ok(info) = &told {
        let _ = info.to_string();
    }
    if let Ok(report) = diff(
        &good,
        &bad,
        &DiffOptions {
            tolerance: 1e-9,
            ..Default::default()
        },
    ) {
        let _ = report.to_string();
    }
    let _ = diff(&bad, &bad, &DiffOptions::default());
    if let Ok(log) = Log::open(&bad) {
        for record in log.records().unwrap() {
            if record.is_err() {
                break;
            }
        }
    }
    match recover(&bad, &out) {
        // Whatever is saved is a whole file.
        Ok(report) => {
            let saved = mcap::MessageStream::new(&fs::read(&out).unwrap())
                .unwrap()
                .count() as u64;
            assert_eq!(saved, report.messages);
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn random_bytes(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        read_all(&bytes);
    }

    #[test]
    fn random_bytes_behind_the_magic(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        let mut file = b"\x89MCAP0\r\n".to_vec();
        file.extend(bytes);
        read_all(&file);
    }

    #[test]
    fn flipped_bits(flips in proptest::collection::vec((any::<prop::sample::Index>(), 0u8..8), 1..6)) {
        let mut file = small_log().to_vec();
        for (at, bit) in flips {
            let at = at.index(file.len());
            file[at] ^= 1 << bit;
        }
        read_all(&file);
    }

    #[test]
    fn cuts(at in any::<prop::sample::Index>()) {
        read_all(&small_log()[..at.index(small_log().len())]);
    }

    #[test]
    fn records_of_any_kind(
        records in proptest::collection::vec(
            (1u8..0x10, proptest::collection::vec(any::<u8>(), 0..60), -3i64..3), 0..12)
    ) {
        let mut file = b"\x89MCAP0\r\n".to_vec();
        for (opcode, content, off) in records {
            file.push(opcode);
            file.extend((content.len() as i64 + off).to_le_bytes());
            file.extend(content);
        }
        read_all(&file);
    }
}

/// An uncompressed chunk of a file without checksums: damage reaches the records themselves.
fn unchecked(inner: &[u8]) -> Vec<u8> {
    let mut file = small_log()[..8].to_vec();
    let mut chunk = Vec::new();
    chunk.extend([0; 16]);
    chunk.extend((inner.len() as u64).to_le_bytes());
    chunk.extend([0; 4]);
    chunk.extend(0u32.to_le_bytes());
    chunk.extend((inner.len() as u64).to_le_bytes());
    chunk.extend(inner);
    file.push(6);
    file.extend((chunk.len() as u64).to_le_bytes());
    file.extend(chunk);
    file
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn damage_within_chunks(
        records in proptest::collection::vec(
            (1u8..8, proptest::collection::vec(0u8..6, 0..60)), 0..12)
    ) {
        let mut inner = Vec::new();
        for (opcode, content) in records {
            inner.push(opcode);
            inner.extend((content.len() as u64).to_le_bytes());
            inner.extend(content);
        }
        read_all(&unchecked(&inner));
    }
}

#[test]
fn sizes_that_lie_cost_no_memory() {
    for claim in [u64::MAX, 1 << 40, 1 << 28] {
        let mut file = unchecked(&[]);
        // The uncompressed size, and a compression that must allocate for it.
        let chunk = 8 + 9;
        file[chunk + 16..chunk + 24].copy_from_slice(&claim.to_le_bytes());
        read_all(&file);
        // The length of the record.
        file[9..17].copy_from_slice(&claim.to_le_bytes());
        read_all(&file);
    }
}

/// A log whose chunks are not compressed, and which nothing says is damaged: lengths in records are read.
fn open_log() -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let options = LogOptions {
        compression: Compression::None,
        ..options()
    };
    let plan = Plan {
        rovers: 1,
        cycles: 2,
        ..Plan::default()
    };
    log_to(&path, &plan, options);
    let mut bytes = fs::read(&path).unwrap();
    let mut at = 8;
    while at + 9 <= bytes.len() {
        let length = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap()) as usize;
        match bytes[at] {
            mcap::records::op::CHUNK => bytes[at + 33..at + 37].fill(0),
            mcap::records::op::DATA_END => bytes[at + 9..at + 13].fill(0),
            _ => {}
        }
        at += 9 + length;
    }
    bytes
}

/// However long something says that it is, and wherever: what is read takes as much memory as what is there.
#[test]
fn lengths_that_lie_cost_no_memory_wherever_they_stand() {
    let whole = open_log();
    let usual = allocation_counter::measure(|| read_all(&whole)).bytes_max;
    for at in (8..whole.len() - 8).step_by(223) {
        for (bytes, claim) in [(8, u64::MAX), (8, 1 << 40), (8, 1 << 28), (4, 1 << 31)] {
            let mut broken = whole.clone();
            broken[at..at + bytes].copy_from_slice(&claim.to_le_bytes()[..bytes]);
            let most = allocation_counter::measure(|| read_all(&broken)).bytes_max;
            // The largest message that is allowed is not there.
            assert!(
                most < 2 * usual + (4 << 20),
                "{claim} at {at}: {most} bytes, and {usual} for the whole file"
            );
        }
    }
}

#[test]
fn a_message_on_an_unknown_channel_costs_only_itself() {
    let mut channel = 1u16.to_le_bytes().to_vec();
    channel.extend([0; 2]);
    for text in ["/known", "json"] {
        channel.extend((text.len() as u32).to_le_bytes());
        channel.extend(text.as_bytes());
    }
    channel.extend([0; 4]);
    let message = |channel: u16| [&channel.to_le_bytes()[..], &[0; 20], b"{}"].concat();
    let records = [
        (4u8, channel),
        (5, message(1)),
        (5, message(2)),
        (5, message(2)),
        (5, message(1)),
    ];
    let mut inner = Vec::new();
    for (opcode, content) in records {
        inner.push(opcode);
        inner.extend((content.len() as u64).to_le_bytes());
        inner.extend(content);
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a");
    std::fs::write(&path, unchecked(&inner)).unwrap();
    let info = info(&path).unwrap();
    assert_eq!(info.messages, 2);
    let strays = info
        .missing
        .iter()
        .filter(|what| what.contains("channel 2"));
    assert_eq!(strays.count(), 1, "{:?}", info.missing);
}

/// Why logs are read by code of their own: what mcap's reader makes of two broken files. If this
/// fails, mcap has become more careful, and `src/parse.rs` may be replaced.
#[test]
fn mcaps_own_reader_is_for_files_in_order() {
    use std::panic::catch_unwind;

    // An attachment that ends in front of its checksum: times, two empty texts, no data.
    let attachment = [0; 8 + 8 + 4 + 4 + 8];
    let parsed =
        catch_unwind(|| mcap::parse_record(mcap::records::op::ATTACHMENT, &attachment).is_ok());
    assert!(parsed.is_err(), "it is refused or read, without a panic");

    // An uncompressed chunk of 9 bytes, in which a record of 50 bytes begins: it goes on in what
    // follows the chunk.
    let mut file = mcap::MAGIC.to_vec();
    let mut chunk = [0; 8 + 8].to_vec();
    chunk.extend(9u64.to_le_bytes());
    chunk.extend([0; 4 + 4]);
    chunk.extend(9u64.to_le_bytes());
    chunk.push(0x80);
    chunk.extend(50u64.to_le_bytes());
    file.push(mcap::records::op::CHUNK);
    file.extend((chunk.len() as u64).to_le_bytes());
    file.extend(chunk);
    file.extend([7; 64]);
    let read_beyond_the_chunk = catch_unwind(move || {
        let mut reader = mcap::sans_io::LinearReader::new();
        reader.insert(file.len()).copy_from_slice(&file);
        reader.notify_read(file.len());
        match reader.next_event() {
            Some(Ok(mcap::sans_io::LinearReadEvent::Record { data, .. })) => data == [7; 50],
            _ => false,
        }
    });
    // With checks for overflow it panics, without it reads on.
    assert!(read_beyond_the_chunk.unwrap_or(true), "it is refused");
}

/// A schema in a syntax that the reader of descriptors does not know: no fields, and no panic.
#[test]
fn schemas_of_unknown_syntax_are_compared_as_bytes() {
    let folder = tempfile::tempdir().unwrap();
    // A FileDescriptorSet with one file: its name, a message M, its syntax.
    let schema = b"\x0a\x16\x0a\x02.p\x22\x03\x0a\x01Mb\x08editionsp\xe8\x07";
    let [a, b] = [1u8, 2].map(|value| {
        let path = folder.path().join(format!("{value}.mcap"));
        let mut writer = mcap::Writer::new(fs::File::create(&path).unwrap()).unwrap();
        let schema = writer.add_schema("M", "protobuf", schema).unwrap();
        let channel = writer.add_channel(schema, "/x", "protobuf", &BTreeMap::new());
        let header = mcap::records::MessageHeader {
            channel_id: channel.unwrap(),
            sequence: 0,
            log_time: 1,
            publish_time: 1,
        };
        writer.write_to_known_channel(&header, &[8, value]).unwrap();
        writer.finish().unwrap();
        path
    });
    let report = diff(&a, &b, &DiffOptions::default()).unwrap();
    assert!(!report.identical);
    assert!(report.to_string().contains("/x"), "{report}");
}
