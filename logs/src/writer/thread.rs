//! The thread that compresses and writes: it takes whole chunks from a bounded queue and gives
//! their buffers back.

use std::collections::BTreeMap;
use std::fs::OpenOptions;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread::JoinHandle;

use super::Compression;
use super::chunk::Chunk;
use super::file::McapFile;
use crate::LogError;
use crate::output::lock;

/// Chunks on their way to the thread before the run waits.
const QUEUE_CHUNKS: usize = 3;

pub(super) type File = McapFile<BufWriter<std::fs::File>>;

/// Creates the file and writes MCAP's own header. A file that another run is writing stays as it is.
pub(super) fn create(
    path: &Path,
    compression: Compression,
    code_version: &str,
) -> Result<File, LogError> {
    let failed = |error| LogError::io(path, "create", error);
    let mut options = OpenOptions::new();
    let file = options.write(true).create(true).truncate(false).open(path);
    let file = file.map_err(failed)?;
    // Devices and pipes take what comes, whoever it is from.
    if file.metadata().is_ok_and(|found| found.is_file()) {
        lock(&file, path)?;
        file.set_len(0).map_err(failed)?;
    }
    // What is larger than the buffer, as chunks mostly are, is not copied into it.
    McapFile::create(BufWriter::new(file), compression, library(code_version))
        .map_err(|error| LogError::io(path, "write", error))
}

/// What a log says wrote it: this library, or the binary of somebody else's whose version names it.
fn library(code_version: &str) -> String {
    match code_version.contains(" (farside ") {
        true => code_version.to_owned(),
        false => concat!("farside ", env!("CARGO_PKG_VERSION")).to_owned(),
    }
}

enum Job {
    Write(Chunk),
    /// The last metadata, by name.
    Finish(&'static str, BTreeMap<String, String>),
}

/// The thread, seen from the run.
pub(super) struct Worker {
    path: PathBuf,
    jobs: Option<SyncSender<Job>>,
    spares: Receiver<Chunk>,
    thread: Option<JoinHandle<Result<(), LogError>>>,
}

impl Worker {
    pub(super) fn spawn(path: PathBuf, file: File) -> Result<Self, LogError> {
        let (jobs, job_queue) = sync_channel(QUEUE_CHUNKS);
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

    /// An empty chunk, with a buffer that was used before if there is one.
    pub(super) fn spare(&self) -> Chunk {
        self.spares.try_recv().unwrap_or_default()
    }

    /// Gives a chunk to the thread; waits if it is far behind.
    pub(super) fn send(&mut self, chunk: Chunk) -> Result<(), LogError> {
        self.give(Job::Write(chunk))
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
    pub(super) fn finish(
        mut self,
        name: &'static str,
        end: BTreeMap<String, String>,
    ) -> Result<(), LogError> {
        self.give(Job::Finish(name, end))?;
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
    mut file: File,
    jobs: &Receiver<Job>,
    spares: &Sender<Chunk>,
) -> Result<(), LogError> {
    let refused = |error| LogError::io(path, "write", error);
    while let Ok(job) = jobs.recv() {
        match job {
            Job::Write(mut chunk) => {
                file.chunk(chunk.bytes()).map_err(refused)?;
                chunk.clear();
                // Nobody takes it back once the run is over.
                let _ = spares.send(chunk);
            }
            Job::Finish(name, end) => {
                file.metadata(name, end).map_err(refused)?;
                return close(path, file.finish().map_err(refused)?);
            }
        }
    }
    Ok(())
}

/// Waits for the disk: only now is a full one certain to have shown.
fn close(path: &Path, file: BufWriter<std::fs::File>) -> Result<(), LogError> {
    match file.get_ref().sync_all() {
        // A pipe or a device has no disk to wait for.
        Err(error) if error.kind() == io::ErrorKind::InvalidInput => Ok(()),
        Err(error) => Err(LogError::io(path, "write", error)),
        Ok(()) => Ok(()),
    }
}
