//! The thread that compresses and writes: it takes batches of encoded messages from a bounded
//! queue and gives their buffers back.

use std::collections::BTreeMap;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread::JoinHandle;

use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;

use super::Compression;
use crate::LogError;
use crate::descriptors::SchemaOf;

/// Batches on their way to the thread before the run waits.
const QUEUE_BATCHES: usize = 8;

/// The bytes in front of each message of a batch.
const HEADER_BYTES: usize = 2 + 4 + 8 + 8 + 4;

pub(super) type File = mcap::Writer<NoSeek<BufWriter<std::fs::File>>>;

/// Creates the file and writes MCAP's own header.
pub(super) fn create(
    path: &Path,
    compression: Compression,
    code_version: &str,
) -> Result<Box<File>, LogError> {
    let file = std::fs::File::create(path).map_err(|error| LogError::io(path, "create", error))?;
    let writer = options(compression)
        .library(library(code_version))
        .create(NoSeek::new(BufWriter::with_capacity(256 * 1024, file)))
        .map_err(|error| LogError::mcap(path, error))?;
    Ok(Box::new(writer))
}

/// What a log says wrote it: this library, or the binary of somebody else's whose version names it.
fn library(code_version: &str) -> String {
    match code_version.contains(" (farside ") {
        true => code_version.to_owned(),
        false => concat!("farside ", env!("CARGO_PKG_VERSION")).to_owned(),
    }
}

/// The same options on every machine: the bytes of a log depend on the run alone.
pub(crate) fn options(compression: Compression) -> mcap::WriteOptions {
    let options = mcap::WriteOptions::new()
        .library(concat!("farside ", env!("CARGO_PKG_VERSION")))
        // Buffers the open chunk, so that a killed writer leaves a clean prefix.
        .disable_seeking(true)
        .compression_threads(0);
    match compression {
        Compression::Zstd => options.compression(Some(mcap::Compression::Zstd)),
        Compression::None => options.compression(None),
    }
}

/// What must be written before the messages that use it.
pub(super) enum Declaration {
    Schema {
        id: u16,
        schema: SchemaOf,
    },
    Channel {
        id: u16,
        schema_id: u16,
        topic: String,
        metadata: BTreeMap<String, String>,
    },
}

/// The head of one message.
#[derive(Clone, Copy)]
pub(super) struct Header {
    pub(super) channel: u16,
    pub(super) sequence: u32,
    pub(super) log_time: u64,
    pub(super) publish_time: u64,
}

impl Header {
    fn to_bytes(self, length: u32) -> [u8; HEADER_BYTES] {
        let mut bytes = [0; HEADER_BYTES];
        bytes[0..2].copy_from_slice(&self.channel.to_le_bytes());
        bytes[2..6].copy_from_slice(&self.sequence.to_le_bytes());
        bytes[6..14].copy_from_slice(&self.log_time.to_le_bytes());
        bytes[14..22].copy_from_slice(&self.publish_time.to_le_bytes());
        bytes[22..26].copy_from_slice(&length.to_le_bytes());
        bytes
    }

    fn from_bytes(bytes: &[u8; HEADER_BYTES]) -> (Self, usize) {
        let [c0, c1, s0, s1, s2, s3, ..] = *bytes;
        let word = |at: usize| {
            let mut word = [0; 8];
            word.copy_from_slice(&bytes[at..at + 8]);
            u64::from_le_bytes(word)
        };
        let header = Header {
            channel: u16::from_le_bytes([c0, c1]),
            sequence: u32::from_le_bytes([s0, s1, s2, s3]),
            log_time: word(6),
            publish_time: word(14),
        };
        let length = u32::from_le_bytes([bytes[22], bytes[23], bytes[24], bytes[25]]);
        (header, length as usize)
    }
}

/// Messages on their way to the thread, in one buffer.
#[derive(Default)]
pub(super) struct Batch {
    declarations: Vec<Declaration>,
    bytes: Vec<u8>,
    end_chunk: bool,
}

impl Batch {
    pub(super) fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    pub(super) fn len(&self) -> usize {
        self.bytes.len()
    }

    pub(super) fn declare(&mut self, declaration: Declaration) {
        self.declarations.push(declaration);
    }

    /// Ends the chunk, and gives it to the operating system, once the batch is written.
    pub(super) fn end_chunk(&mut self) {
        self.end_chunk = true;
    }

    pub(super) fn message(&mut self, header: Header, encode: impl FnOnce(&mut Vec<u8>)) {
        let start = self.bytes.len();
        self.bytes.extend_from_slice(&[0; HEADER_BYTES]);
        encode(&mut self.bytes);
        let length = self.bytes.len() - start - HEADER_BYTES;
        // No message of a simulation has 4 GiB: it would not have fitted into memory twice.
        let length = u32::try_from(length).unwrap_or(u32::MAX);
        self.bytes[start..start + HEADER_BYTES].copy_from_slice(&header.to_bytes(length));
    }

    /// Gives all messages of the batch this time.
    pub(super) fn set_log_times(&mut self, log_time: u64) {
        let mut rest = self.bytes.as_mut_slice();
        while let Some((head, after)) = rest.split_first_chunk_mut::<HEADER_BYTES>() {
            let (header, length) = Header::from_bytes(head);
            *head = Header { log_time, ..header }.to_bytes(length as u32);
            rest = after.get_mut(length..).unwrap_or_default();
        }
    }

    fn clear(&mut self) {
        self.declarations.clear();
        self.bytes.clear();
        self.end_chunk = false;
    }

    fn write(&mut self, file: &mut File) -> mcap::McapResult<()> {
        for declaration in self.declarations.drain(..) {
            match declaration {
                Declaration::Schema { id, schema } => {
                    file.add_schema_with_id(id, &schema.name, "protobuf", &schema.data)?;
                }
                Declaration::Channel {
                    id,
                    schema_id,
                    topic,
                    metadata,
                } => {
                    file.add_channel_with_id(id, schema_id, &topic, "protobuf", &metadata)?;
                }
            }
        }
        let mut rest = self.bytes.as_slice();
        while let Some((head, after)) = rest.split_first_chunk::<HEADER_BYTES>() {
            let (header, length) = Header::from_bytes(head);
            let (data, after) = after.split_at(length);
            let header = MessageHeader {
                channel_id: header.channel,
                sequence: header.sequence,
                log_time: header.log_time,
                publish_time: header.publish_time,
            };
            file.write_to_known_channel(&header, data)?;
            rest = after;
        }
        if self.end_chunk {
            file.flush()?;
        }
        Ok(())
    }
}

enum Job {
    Write(Batch),
    Finish(Metadata),
}

/// The thread, seen from the run.
pub(super) struct Worker {
    path: PathBuf,
    jobs: Option<SyncSender<Job>>,
    spares: Receiver<Batch>,
    thread: Option<JoinHandle<Result<(), LogError>>>,
}

impl Worker {
    pub(super) fn spawn(path: PathBuf, file: Box<File>) -> Result<Self, LogError> {
        let (jobs, job_queue) = sync_channel(QUEUE_BATCHES);
        let (spare_queue, spares) = channel();
        let thread_path = path.clone();
        let thread = std::thread::Builder::new()
            .name("log-writer".to_owned())
            .spawn(move || work(&thread_path, file, &job_queue, &spare_queue))
            .map_err(|error| LogError::io(&path, "start a thread to write", error))?;
        Ok(Worker {
            path,
            jobs: Some(jobs),
            spares,
            thread: Some(thread),
        })
    }

    /// An empty batch, with a buffer that was used before if there is one.
    pub(super) fn spare(&self) -> Batch {
        self.spares.try_recv().unwrap_or_default()
    }

    /// Gives a batch to the thread; waits if it is far behind.
    pub(super) fn send(&mut self, batch: Batch) -> Result<(), LogError> {
        self.give(Job::Write(batch))
    }

    fn give(&mut self, job: Job) -> Result<(), LogError> {
        let given = self.jobs.as_ref().map(|jobs| jobs.send(job));
        match given {
            Some(Ok(())) => Ok(()),
            // The thread is gone: it says why.
            _ => self.join(),
        }
    }

    /// Writes the end, closes the file, and waits until it is on the disk.
    pub(super) fn finish(mut self, end: Metadata) -> Result<(), LogError> {
        self.give(Job::Finish(end))?;
        self.join()
    }

    fn join(&mut self) -> Result<(), LogError> {
        self.jobs = None;
        let stopped = || {
            let reason = io::Error::other("the writing thread has stopped");
            LogError::io(&self.path, "write", reason)
        };
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(result)) => result,
            Some(Err(_)) | None => Err(stopped()),
        }
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        // A run that never ended: what was handed over is written, and the file is a prefix.
        if self.thread.is_some() {
            let _ = self.join();
        }
    }
}

fn work(
    path: &Path,
    mut file: Box<File>,
    jobs: &Receiver<Job>,
    spares: &Sender<Batch>,
) -> Result<(), LogError> {
    let refused = |error| LogError::mcap(path, error);
    while let Ok(job) = jobs.recv() {
        match job {
            Job::Write(mut batch) => {
                batch.write(&mut file).map_err(refused)?;
                batch.clear();
                // Nobody takes it back once the run is over.
                let _ = spares.send(batch);
            }
            Job::Finish(end) => {
                file.write_metadata(&end).map_err(refused)?;
                file.finish().map_err(refused)?;
                return close(path, *file);
            }
        }
    }
    Ok(())
}

/// Empties the buffers and waits for the disk: only now is a full disk certain to have shown.
fn close(path: &Path, file: File) -> Result<(), LogError> {
    let buffered = file.into_inner().into_inner();
    let file = buffered
        .into_inner()
        .map_err(|error| LogError::io(path, "write", error.into_error()))?;
    match file.sync_all() {
        // A pipe or a device has no disk to wait for.
        Err(error) if error.kind() == io::ErrorKind::InvalidInput => Ok(()),
        Err(error) => Err(LogError::io(path, "write", error)),
        Ok(()) => Ok(()),
    }
}
