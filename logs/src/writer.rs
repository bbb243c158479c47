//! Writing a log while a run goes on: records are encoded where they are committed, chunk by chunk,
//! and a thread compresses and writes each whole chunk.
//!
//! What this is not: a way to slow a run down or to change it. The writer sees committed records
//! only; when the disk cannot keep up, a bounded queue makes the run wait, and nothing else.

mod chunk;
mod file;
mod foxglove;
mod records;
mod thread;
mod viewer;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use farside::key::EventKey;
use farside::record::{Checkpoint, Flow, Observer, ObserverError, Record, RecordClass, Wants};
use farside::scene::Scene;
use farside::{Kind, Report, RunInfo};
use mcap::records::{AttachmentHeader, MessageHeader};
use xxhash_rust::xxh3::xxh3_128;

use crate::LogError;
use crate::descriptors::{self, SchemaOf};
use crate::envelope::{Encoder, put_key};
use crate::topics::{self, CHECKPOINT, Topics};
use crate::wire::{put_bytes, put_number, put_text};
use chunk::Chunk;
use thread::{File, Worker};
use viewer::Stage;

/// The version of the format: a reader reads every minor version of the majors it knows.
pub(crate) const FORMAT_MAJOR: u32 = 1;
pub(crate) const FORMAT_MINOR: u32 = 3;

/// The attachment that holds the resolved scenario.
pub(crate) const SCENARIO_ATTACHMENT: &str = "scenario.toml";

/// A file that the run read, or that explains it, kept in the log whole.
///
/// ```
/// use farside_logs::Attachment;
/// let plan = Attachment {
///     name: "contacts.json".to_owned(),
///     media_type: "application/json".to_owned(),
///     bytes: b"[]".to_vec(),
/// };
/// assert_eq!(plan.bytes.len(), 2);
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Attachment {
    /// Its name, unique within the log.
    pub name: String,
    /// Its media type, as in `text/plain`.
    pub media_type: String,
    /// Its content.
    pub bytes: Vec<u8>,
}

/// How the chunks of a log are compressed.
///
/// ```
/// assert_eq!(farside_logs::Compression::default(), farside_logs::Compression::Zstd);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Compression {
    /// Zstandard, at its default level.
    #[default]
    Zstd,
    /// Not at all.
    None,
}

/// What a log holds besides the records, and which records it holds.
///
/// ```
/// use farside_logs::LogOptions;
/// let options = LogOptions {
///     scenario: "network/crater-dense".to_owned(),
///     // Leave out the delivered gossip, and keep what of it was lost.
///     exclude: vec!["/*/max_plus".to_owned()],
///     ..LogOptions::default()
/// };
/// assert_eq!(options.epoch_ns, 0);
/// ```
#[derive(Debug, Default)]
pub struct LogOptions {
    /// The scenario's name.
    pub scenario: String,
    /// The scenario as it was resolved, from which the run can be executed again.
    pub resolved: String,
    /// The version of the code that runs.
    pub code_version: String,
    /// What else is to be known about the run.
    pub run: BTreeMap<String, String>,
    /// What may differ from machine to machine: executor, threads, host name. Never compared.
    pub host: BTreeMap<String, String>,
    /// Files to keep in the log.
    pub attachments: Vec<Attachment>,
    /// Topics that are not written, as globs; `*` does not match `/`, `**` does.
    pub exclude: Vec<String>,
    /// Draws the run for viewers.
    pub scene: Option<Box<dyn Scene>>,
    /// Added to every time that MCAP itself stores, and that viewers are told, in nanoseconds since
    /// 1970.
    pub epoch_ns: u64,
    /// How chunks are compressed.
    pub compression: Compression,
}

/// Writes a run to a log: an observer to give to a simulation.
///
/// ```
/// use farside::prelude::*;
/// use farside_logs::{LogOptions, LogWriter};
/// # struct Clock;
/// # #[derive(serde::Serialize, serde::Deserialize)]
/// # struct Tick { count: u32 }
/// # impl Actor for Clock {
/// #     type Accepts = (Tick,);
/// #     fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
/// #         ctx.timer(SimDuration::from_secs(1), Tick { count: 1 });
/// #         Ok(())
/// #     }
/// # }
/// # impl Handler<Tick> for Clock {
/// #     fn handle(&mut self, _tick: Tick, _ctx: &mut Context<'_, Self>) -> Outcome { Ok(()) }
/// # }
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("run.mcap");
///
/// let mut sim = Simulation::new(7);
/// let host = sim.host("moon");
/// sim.actor(host, "clock", |_name| Clock);
/// sim.observe(LogWriter::create(&path, LogOptions::default())?);
/// let report = sim.run(Executor::Inline)?;
///
/// let run = farside_logs::info(&path)?.run.unwrap();
/// assert_eq!(run.digest, Some(report.digest.to_string()));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct LogWriter {
    path: PathBuf,
    options: LogOptions,
    exclude: Option<Topics>,
    file: Option<File>,
    live: Option<Live>,
}

/// What exists from the run's begin to its end.
struct Live {
    encoder: Encoder,
    channels: Channels,
    worker: Worker,
    chunk: Chunk,
    /// From the first message in flight on: their `log_time` is the end, which is not known yet.
    at_end: Vec<Chunk>,
    checkpoint_channel: u16,
    /// None if nothing is drawn.
    stage: Option<Stage>,
    epoch_ns: u64,
    last_ns: u64,
    written: u64,
    checkpoints: u32,
}

/// The most channels of single actors. MCAP numbers channels in 16 bits; the rest is for those that all other
/// actors share, and for what is drawn.
const OWN_CHANNELS: usize = u16::MAX as usize - 8192;

/// Channels and schemas declared so far, by content.
struct Channels {
    schemas: BTreeMap<String, u16>,
    channels: BTreeMap<(String, &'static str, u16), u16>,
    /// From how many on actors share theirs.
    own: usize,
}

impl Default for Channels {
    fn default() -> Channels {
        Channels {
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
            own: OWN_CHANNELS,
        }
    }
}

impl LogWriter {
    /// A writer to a new file at `path`; a file that is there already is replaced. From now on the
    /// file says what scenario it is of, whenever the run begins.
    ///
    /// # Errors
    /// If the file cannot be created, if another run is writing it, or if a glob cannot be read.
    pub fn create(path: impl AsRef<Path>, options: LogOptions) -> Result<LogWriter, LogError> {
        let path = path.as_ref().to_owned();
        let exclude = Topics::new(&options.exclude)?;
        let mut file = thread::create(&path, options.compression, &options.code_version)?;
        let scenario = Attachment {
            name: SCENARIO_ATTACHMENT.to_owned(),
            media_type: "application/toml".to_owned(),
            bytes: options.resolved.clone().into_bytes(),
        };
        put_attachment(&mut file, scenario, options.epoch_ns)
            .map_err(|error| LogError::io(&path, "write", error))?;
        // Whoever kills a run early has this. A disk that is full says so again when the first chunk
        // is written, and that ends the run as any later time.
        let _ = file.flush();
        Ok(LogWriter {
            path,
            options,
            exclude: Some(exclude),
            file: Some(file),
            live: None,
        })
    }

    fn head(&self, run: &RunInfo) -> BTreeMap<String, String> {
        let options = &self.options;
        let mut head = BTreeMap::new();
        let mut put = |key: &str, value: String| head.insert(key.to_owned(), value);
        put("format", format!("{FORMAT_MAJOR}.{FORMAT_MINOR}"));
        put("code_version", options.code_version.clone());
        put("seed", run.seed.to_string());
        if let Some(tie_seed) = run.tie_seed {
            put("tie_seed", tie_seed.to_string());
        }
        put("scenario", options.scenario.clone());
        let hash = xxh3_128(options.resolved.as_bytes());
        put("scenario_hash", format!("{hash:032x}"));
        put("epoch_ns", options.epoch_ns.to_string());
        put("exclude", serde_json::json!(options.exclude).to_string());
        put("look_ahead_ns", run.look_ahead.as_nanos().to_string());
        head
    }

    fn start(&mut self, run: &Arc<RunInfo>) -> Result<Live, LogError> {
        let finished = || LogError::Unfinished {
            path: self.path.clone(),
        };
        let mut file = self.file.take().ok_or_else(finished)?;
        let exclude = self.exclude.take().ok_or_else(finished)?;
        let head = self.head(run);
        let refused = |error| LogError::io(&self.path, "write", error);
        let options = &mut self.options;
        for (name, metadata) in [
            ("farside", head),
            ("farside.run", std::mem::take(&mut options.run)),
            ("farside.host", std::mem::take(&mut options.host)),
        ] {
            file.metadata(name, metadata).map_err(refused)?;
        }
        for attachment in std::mem::take(&mut options.attachments) {
            put_attachment(&mut file, attachment, options.epoch_ns).map_err(refused)?;
        }
        // Whoever opens the log while the run goes on sees what it is of.
        let _ = file.flush();
        let worker = Worker::spawn(self.path.clone(), file)?;
        let mut chunk = Chunk::default();
        let mut channels = Channels::default();
        let checkpoint_channel = channels.get(
            &mut chunk,
            CHECKPOINT,
            "checkpoint",
            "",
            descriptors::checkpoint,
        )?;
        let scene = self.options.scene.take();
        let mut live = Live {
            encoder: Encoder::new(run.clone(), exclude),
            channels,
            worker,
            chunk,
            at_end: Vec::new(),
            checkpoint_channel,
            stage: scene.map(|scene| Stage::new(scene, run.clone())),
            epoch_ns: self.options.epoch_ns,
            last_ns: 0,
            written: 0,
            checkpoints: 0,
        };
        live.draw_begin()?;
        Ok(live)
    }
}

fn put_attachment(file: &mut File, attachment: Attachment, epoch_ns: u64) -> std::io::Result<()> {
    let head = AttachmentHeader {
        log_time: epoch_ns,
        create_time: epoch_ns,
        name: attachment.name,
        media_type: attachment.media_type,
    };
    file.attachment(head, &attachment.bytes)
}

impl Channels {
    /// The topic that takes the records of `topic` once there can be no more channels of single actors; none
    /// while there can, and for a topic that has its channel.
    fn topic_of_all(&self, topic: &str) -> Option<String> {
        if self.channels.len() < self.own {
            return None;
        }
        let first = (topic.to_owned(), "", 0);
        let mut known = self.channels.range(first..);
        let is_known = known.next().is_some_and(|((known, ..), _)| known == topic);
        (!is_known).then(|| topics::of_all_actors(topic))
    }

    /// The channel of `topic` in this role, declared if it is new.
    fn get(
        &mut self,
        chunk: &mut Chunk,
        topic: &str,
        role: &'static str,
        kind: &str,
        schema: impl FnOnce() -> SchemaOf,
    ) -> Result<u16, LogError> {
        let schema = schema();
        let schema_id = match self.schemas.get(&schema.name) {
            Some(id) => *id,
            None => {
                // At most one schema for each channel: they run out after the channels.
                let id = u16::try_from(self.schemas.len() + 1).map_err(|_| too_many(topic))?;
                self.schemas.insert(schema.name.clone(), id);
                chunk.schema(id, schema);
                id
            }
        };
        let key = (topic.to_owned(), role, schema_id);
        if let Some(id) = self.channels.get(&key) {
            return Ok(*id);
        }
        let id = u16::try_from(self.channels.len()).map_err(|_| too_many(topic))?;
        self.channels.insert(key, id);
        let mut metadata = BTreeMap::from([("role".to_owned(), role.to_owned())]);
        if !kind.is_empty() {
            metadata.insert("kind".to_owned(), kind.to_owned());
        }
        chunk.channel(id, schema_id, topic, metadata);
        Ok(id)
    }
}

fn too_many(topic: &str) -> LogError {
    LogError::TooManyTopics {
        topic: topic.to_owned(),
        limit: u16::MAX,
    }
}

fn schema_of(class: RecordClass, kind: Option<&Arc<Kind>>) -> SchemaOf {
    match kind {
        Some(kind) if class == RecordClass::Sample => descriptors::sample(kind),
        Some(kind) => descriptors::record(kind),
        None => descriptors::event(),
    }
}

/// The last chunk, or a new one if that is full.
fn open_chunk(chunks: &mut Vec<Chunk>) -> &mut Chunk {
    if chunks.last().is_none_or(Chunk::is_full) {
        chunks.push(Chunk::default());
    }
    let last = chunks.len() - 1;
    &mut chunks[last]
}

impl Live {
    fn record(&mut self, record: &Record<'_>) -> Result<(), LogError> {
        let index = self.encoder.flow(record);
        let flow = &mut self.encoder.flows[index];
        if flow.excluded {
            self.last_ns = self.last_ns.max(self.log_time(record.class, &record.key));
            return self.draw(record);
        }
        let channel = match flow.channel {
            Some(channel) => channel,
            None => {
                let kind = flow.kind.as_ref();
                let name = kind.map_or("", |kind| kind.name());
                let role = topics::role(flow.class);
                let shared = self.channels.topic_of_all(&flow.topic);
                let topic = shared.as_ref().unwrap_or(&flow.topic);
                // Declarations precede everything that is still to be written.
                let channel = self.channels.get(&mut self.chunk, topic, role, name, || {
                    schema_of(flow.class, kind)
                })?;
                flow.channel = Some(channel);
                channel
            }
        };
        let at_end = record.class == RecordClass::InFlight || !self.at_end.is_empty();
        self.last_ns = self.last_ns.max(self.log_time(record.class, &record.key));
        let header = MessageHeader {
            channel_id: channel,
            sequence: record.ordinal as u32,
            log_time: self.epoch_ns.saturating_add(self.last_ns),
            publish_time: self.epoch_ns.saturating_add(record.sent.as_nanos()),
        };
        let chunk = match at_end {
            true => open_chunk(&mut self.at_end),
            false => &mut self.chunk,
        };
        if record.class == RecordClass::Sample {
            chunk.message(header, |out| out.extend_from_slice(record.body));
        } else {
            let encoder = &self.encoder;
            chunk.message(header, |out| encoder.encode(index, record, out));
        }
        self.written += 1;
        self.draw(record)?;
        self.hand_over_if_full()
    }

    /// A message in flight belongs to the end, whenever it would have arrived.
    fn log_time(&self, class: RecordClass, key: &EventKey) -> u64 {
        match class {
            RecordClass::InFlight => self.last_ns,
            _ => key.time.as_nanos(),
        }
    }

    fn hand_over_if_full(&mut self) -> Result<(), LogError> {
        match self.chunk.is_full() {
            true => self.hand_over(),
            false => Ok(()),
        }
    }

    fn hand_over(&mut self) -> Result<(), LogError> {
        if self.chunk.is_empty() {
            return Ok(());
        }
        let next = self.worker.spare();
        let full = std::mem::replace(&mut self.chunk, next);
        self.worker.send(full)
    }

    fn checkpoint(&mut self, checkpoint: &Checkpoint<'_>) -> Result<(), LogError> {
        let header = MessageHeader {
            channel_id: self.checkpoint_channel,
            sequence: self.checkpoints,
            log_time: self.epoch_ns.saturating_add(self.last_ns),
            publish_time: self.epoch_ns.saturating_add(self.last_ns),
        };
        self.checkpoints += 1;
        let source = self.encoder.name(&checkpoint.key).to_owned();
        let encode = |out: &mut Vec<u8>| {
            put_text(out, 1, &checkpoint.digest.to_string());
            put_key(out, 2, &checkpoint.key, &source);
            put_number(out, 3, checkpoint.records);
            let hashes: Vec<u8> = checkpoint
                .hashes
                .iter()
                .flat_map(|h| h.to_le_bytes())
                .collect();
            put_bytes(out, 4, &hashes);
        };
        if !self.at_end.is_empty() {
            open_chunk(&mut self.at_end).message(header, encode);
            return Ok(());
        }
        self.chunk.message(header, encode);
        // A chunk ends here, so that a log cut later is whole up to a checkpoint.
        self.hand_over()
    }

    fn end(mut self, report: &Report) -> Result<(), LogError> {
        let end_ns = report.end_time.as_nanos().max(self.last_ns);
        self.hand_over()?;
        for mut chunk in std::mem::take(&mut self.at_end) {
            chunk.set_log_times(self.epoch_ns.saturating_add(end_ns));
            self.worker.send(chunk)?;
        }
        let mut end = BTreeMap::new();
        let mut put = |key: &str, value: String| end.insert(key.to_owned(), value);
        put("digest", report.digest.to_string());
        put("end", report.end.name().to_owned());
        put("end_detail", report.end.detail());
        put("end_time_ns", report.end_time.as_nanos().to_string());
        put("records", self.written.to_string());
        put("checkpoints", self.checkpoints.to_string());
        // Maps of strings to numbers always become JSON.
        let counts = serde_json::to_string(&report.counts).unwrap_or_default();
        put("counts", counts);
        self.worker.finish("farside.end", end)
    }
}

impl LogWriter {
    /// Runs `work` on the open log; after a failure there is none.
    fn with_live(
        &mut self,
        work: impl FnOnce(&mut Live) -> Result<(), LogError>,
    ) -> Result<(), ObserverError> {
        let Some(live) = &mut self.live else {
            let path = self.path.display();
            return Err(ObserverError(format!("{path}: the log is closed")));
        };
        match work(live) {
            Ok(()) => Ok(()),
            Err(error) => {
                self.live = None;
                Err(ObserverError(error.to_string()))
            }
        }
    }
}

impl Observer for LogWriter {
    fn wants(&self) -> Wants {
        Wants {
            bodies: true,
            samples: true,
            checkpoints: true,
        }
    }

    fn begin(&mut self, run: &Arc<RunInfo>) -> Result<(), ObserverError> {
        match self.start(run) {
            Ok(live) => {
                self.live = Some(live);
                Ok(())
            }
            Err(error) => Err(ObserverError(error.to_string())),
        }
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        self.with_live(|live| live.record(record))
            .map(|()| Flow::Continue)
    }

    fn checkpoint(&mut self, checkpoint: &Checkpoint<'_>) -> Result<(), ObserverError> {
        self.with_live(|live| live.checkpoint(checkpoint))
    }

    fn end(&mut self, report: &Report) -> Result<(), ObserverError> {
        match self.live.take() {
            Some(live) => live
                .end(report)
                .map_err(|error| ObserverError(error.to_string())),
            // The failure was reported when it happened, and is why the run ended.
            None => match &report.end {
                farside::End::ObserverFailed(reason) => Err(ObserverError(reason.clone())),
                _ => Err(ObserverError(format!(
                    "{}: the log is closed",
                    self.path.display()
                ))),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whatever a run has of actors, it is logged: beyond what MCAP can number, topics are shared by kind.
    #[test]
    fn actors_beyond_the_last_channel_share_topics() {
        let mut channels = Channels {
            own: 3,
            ..Channels::default()
        };
        let mut chunk = Chunk::default();
        let mut declare = |topic: &str| {
            let shared = channels.topic_of_all(topic);
            let topic = shared.unwrap_or_else(|| topic.to_owned());
            channels
                .get(&mut chunk, &topic, "message", "", descriptors::event)
                .map(|id| (topic, id))
                .unwrap()
        };
        let topics = [
            "/a/ping",
            "/b/ping",
            "/c/ping",
            "/d/ping",
            "/lost/d/ping",
            "/e/ping",
            "/b/ping",
        ];
        let declared: Vec<(String, u16)> = topics.map(&mut declare).into();
        let expected = [
            ("/a/ping", 0),
            ("/b/ping", 1),
            ("/c/ping", 2),
            ("/others/ping", 3),
            ("/lost/others/ping", 4),
            ("/others/ping", 3),
            ("/b/ping", 1),
        ];
        assert_eq!(declared, expected.map(|(topic, id)| (topic.to_owned(), id)));
    }
}
