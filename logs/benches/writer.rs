//! How fast a log is written, against the bare MCAP writer with the same messages, and the same
//! compression: the records of a run, 20 rovers that report at 50 Hz, are kept in memory and written
//! again and again. Prints the ratio; the aim is 1.3.
//!
//! What this does not measure: the simulation. With a core to spare it goes on meanwhile.

#[path = "shared/clock.rs"]
mod clock;
#[path = "shared/rovers.rs"]
mod rovers;

use std::io::BufWriter;
use std::path::Path;
use std::sync::{Arc, Mutex};

use clock::{median, ratios, timed};
use farside::prelude::*;
use farside::record::{Checkpoint, Flow, Observer, ObserverError, Record, Wants};
use farside::{Kind, RunInfo};
use farside_logs::{Log, LogOptions, LogWriter};
use rovers::simulate;

/// How often each of the two writes everything.
const PAIRS: usize = 9;

/// A record, kept.
struct Kept {
    record: Record<'static>,
    kind: Option<Arc<Kind>>,
    body: Vec<u8>,
}

enum Told {
    Record(Kept),
    Checkpoint(u64, farside::key::EventKey, farside::Digest, Vec<u32>),
}

#[derive(Default)]
struct Tape {
    run: Option<Arc<RunInfo>>,
    told: Vec<Told>,
}

struct Keeper(Arc<Mutex<Tape>>);

impl Observer for Keeper {
    fn wants(&self) -> Wants {
        Wants {
            bodies: true,
            samples: true,
            checkpoints: true,
        }
    }

    fn begin(&mut self, run: &Arc<RunInfo>) -> Result<(), ObserverError> {
        self.0.lock().unwrap().run = Some(run.clone());
        Ok(())
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        let kept = Kept {
            kind: record.kind.cloned(),
            body: record.body.to_vec(),
            record: Record {
                kind: None,
                body: &[],
                carriage: None,
                ..*record
            },
        };
        self.0.lock().unwrap().told.push(Told::Record(kept));
        Ok(Flow::Continue)
    }

    fn checkpoint(&mut self, point: &Checkpoint<'_>) -> Result<(), ObserverError> {
        let told = Told::Checkpoint(
            point.records,
            point.key,
            point.digest,
            point.hashes.to_vec(),
        );
        self.0.lock().unwrap().told.push(told);
        Ok(())
    }
}

fn write_log(path: &Path, tape: &Tape, report: &Report) {
    let mut writer = LogWriter::create(path, LogOptions::default()).unwrap();
    writer.begin(tape.run.as_ref().unwrap()).unwrap();
    for told in &tape.told {
        match told {
            Told::Record(kept) => {
                let kind = kept.kind.as_ref();
                writer
                    .record(&Record {
                        kind,
                        body: &kept.body,
                        ..kept.record
                    })
                    .unwrap();
            }
            Told::Checkpoint(records, key, digest, hashes) => {
                let point = Checkpoint {
                    records: *records,
                    key: *key,
                    digest: *digest,
                    hashes,
                };
                writer.checkpoint(&point).unwrap();
            }
        }
    }
    writer.end(report).unwrap();
}

/// The same channels and messages, written by the MCAP library alone.
fn write_bare(path: &Path, messages: &[(mcap::records::MessageHeader, Vec<u8>)], like: &[u8]) {
    let summary = mcap::Summary::read(like).unwrap().unwrap();
    let file = BufWriter::new(std::fs::File::create(path).unwrap());
    let mut writer = mcap::WriteOptions::new()
        .compression_threads(0)
        .create(file)
        .unwrap();
    let mut ids = std::collections::BTreeMap::new();
    let mut channels: Vec<_> = summary.channels.values().collect();
    channels.sort_by_key(|channel| channel.id);
    for channel in channels {
        let schema = channel.schema.as_ref().unwrap();
        let schema = writer
            .add_schema(&schema.name, &schema.encoding, &schema.data)
            .unwrap();
        let added = writer
            .add_channel(schema, &channel.topic, "protobuf", &channel.metadata)
            .unwrap();
        ids.insert(channel.id, added);
    }
    for (header, data) in messages {
        let header = mcap::records::MessageHeader {
            channel_id: ids[&header.channel_id],
            ..*header
        };
        writer.write_to_known_channel(&header, data).unwrap();
    }
    writer.finish().unwrap();
    writer
        .into_inner()
        .into_inner()
        .unwrap()
        .sync_all()
        .unwrap();
}

fn main() {
    let folder = tempfile::tempdir().unwrap();
    let (ours, bare) = (
        folder.path().join("ours.mcap"),
        folder.path().join("bare.mcap"),
    );
    let tape = Arc::new(Mutex::new(Tape::default()));
    let report = simulate([Keeper(tape.clone())], 1, 200);
    let tape = tape.lock().unwrap();
    write_log(&ours, &tape, &report);
    assert!(
        Log::open(&ours)
            .unwrap()
            .records()
            .unwrap()
            .all(|record| record.is_ok())
    );
    let like = std::fs::read(&ours).unwrap();
    let messages: Vec<_> = mcap::MessageStream::new(&like)
        .unwrap()
        .map(|message| {
            let message = message.unwrap();
            let header = mcap::records::MessageHeader {
                channel_id: message.channel.id,
                sequence: message.sequence,
                log_time: message.log_time,
                publish_time: message.publish_time,
            };
            (header, message.data.into_owned())
        })
        .collect();
    let bytes: usize = messages.iter().map(|(_, data)| data.len()).sum();
    println!(
        "{} messages, {bytes} bytes, {} in the file",
        messages.len(),
        like.len()
    );
    let mut pairs = Vec::new();
    // Interleaved, so that other work on the machine meets both.
    for _ in 0..PAIRS {
        let (_, farside) = timed(|| write_log(&ours, &tape, &report));
        let (_, peer) = timed(|| write_bare(&bare, &messages, &like));
        pairs.push((farside, peer));
    }
    let size = |path: &Path| std::fs::metadata(path).map_or(0, |found| found.len());
    let rate = |wall_s: Vec<f64>| messages.len() as f64 / median(wall_s) / 1e6;
    let walls = pairs.iter().map(|(ours, peer)| (ours.wall_s, peer.wall_s));
    let (farside, peer) = walls.unzip();
    println!(
        "farside: {:.3} million messages/s, {} bytes",
        rate(farside),
        size(&ours)
    );
    println!(
        "mcap:    {:.3} million messages/s, {} bytes",
        rate(peer),
        size(&bare)
    );
    let [wall, processor] = ratios(&pairs);
    println!("ratio:   {wall:.2} (median of {PAIRS} pairs); of processor time {processor:.2}");
}
