//! How fast a log is written, against the bare MCAP writer with the same messages: records of a
//! run are kept in memory and written again and again. Prints the ratio; the aim is 0.8.
//!
//! What this does not measure: the simulation. With a core to spare it goes on meanwhile.

use std::io::BufWriter;
use std::path::Path;
use std::sync::{Arc, Mutex};

use farside::prelude::*;
use farside::record::{Checkpoint, Flow, Observer, ObserverError, Record, Wants};
use farside::{Kind, RunInfo};
use farside_logs::{Log, LogOptions, LogWriter};
use serde::{Deserialize, Serialize};

#[derive(Serialize, Deserialize)]
struct Pose {
    x_m: f64,
    y_m: f64,
    heading_rad: f64,
    battery: f32,
    goal: Option<(f64, f64)>,
}

struct Rover {
    next: u32,
    rovers: u32,
}

impl Actor for Rover {
    type Accepts = (Pose,);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        let next = ctx.lookup::<Rover>(&format!("rover_{}", self.next))?;
        ctx.send(
            next,
            Pose {
                x_m: 0.0,
                y_m: 0.0,
                heading_rad: 0.0,
                battery: 1.0,
                goal: None,
            },
        );
        Ok(())
    }
}

impl Handler<Pose> for Rover {
    fn handle(&mut self, pose: Pose, ctx: &mut Context<'_, Self>) -> Outcome {
        self.next = (self.next + 1) % self.rovers;
        let next = ctx.lookup::<Rover>(&format!("rover_{}", self.next))?;
        let noise = ctx.random("noise");
        let pose = Pose {
            x_m: pose.x_m + noise.normal(0.0, 0.1),
            y_m: pose.y_m + noise.normal(0.0, 0.1),
            heading_rad: noise.normal(0.0, 1.0),
            battery: pose.battery * 0.999,
            goal: Some((10.0, 20.0)),
        };
        ctx.send(next, pose);
        Ok(())
    }
}

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

fn simulate(observer: impl Observer + 'static, seconds: u64) -> Report {
    let rovers = 32;
    let mut sim = Simulation::new(1);
    for rover in 0..rovers {
        let host = sim.host(&format!("host_{rover}"));
        let next = (rover + 1) % rovers;
        sim.actor(host, &format!("rover_{rover}"), move |_| Rover {
            next,
            rovers,
        });
        let delay = FixedDelay::new(SimDuration::from_millis(5 + u64::from(rover)));
        sim.uplink(host, &format!("radio_{rover}"), delay);
    }
    sim.stop_at(
        SimTime::ZERO + SimDuration::from_secs(seconds),
        "long enough",
    );
    sim.observe(observer);
    sim.run(Executor::Inline).unwrap()
}

#[allow(
    clippy::disallowed_types,
    reason = "a benchmark measures the wall clock"
)]
fn timed(work: impl FnOnce()) -> f64 {
    let start = std::time::Instant::now();
    work();
    start.elapsed().as_secs_f64()
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
    let report = simulate(Keeper(tape.clone()), 200);
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
    let (mut best_ours, mut best_bare) = (f64::MAX, f64::MAX);
    // Alternating, and the best of several: other work on the machine must not decide.
    for _ in 0..7 {
        best_ours = best_ours.min(timed(|| write_log(&ours, &tape, &report)));
        best_bare = best_bare.min(timed(|| write_bare(&bare, &messages, &like)));
    }
    let rate = |seconds: f64| messages.len() as f64 / seconds / 1e6;
    println!("farside: {:.3} million messages/s", rate(best_ours));
    println!("mcap:    {:.3} million messages/s", rate(best_bare));
    println!("ratio:   {:.2}", best_bare / best_ours);
}
