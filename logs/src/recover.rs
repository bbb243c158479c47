//! Saving what can be saved of a cut or damaged file.

mod saved;
mod tally;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::Path;

use serde::Serialize;

use crate::LogError;
use crate::output::{lock_replaced, may_hold_log};
use crate::salvage::{Hints, Part, Salvage};
use crate::shown::Shown;
use crate::source::Source;
use saved::{Declaration, Saved};
pub use tally::{LostMessages, LostToldBy};

/// What was saved of a damaged file, and what was lost.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RecoverReport {
    /// Messages written.
    pub messages: u64,
    /// Of these, messages out of chunks that do not match their checksums or are cut, or whose own
    /// length is doubtful: they are whole, and need not be what was written.
    pub unchecked: u64,
    /// Chunks read.
    pub chunks: u64,
    /// Channels declared, whether they have messages or not.
    pub channels: u64,
    /// Attachments written.
    pub attachments: u64,
    /// Metadata records written.
    pub metadata: u64,
    /// The data has no end: the file is cut, or was never finished, and what would have come is unknown.
    pub cut: bool,
    /// How many messages are lost, of which topics, and from when.
    pub lost_messages: LostMessages,
    /// Bytes of the broken file that held nothing that could be used.
    pub bytes_lost: u64,
    /// How many separate losses there were.
    pub losses: u64,
    /// What was lost, in words: the first hundred losses.
    pub lost: Vec<String>,
    /// What was not as it should be, and could be used all the same.
    pub notes: Vec<String>,
}

/// Losses that are described; further ones are only counted.
const DESCRIBED: usize = 100;

impl RecoverReport {
    /// True if all that the file ever held is in the new one, and none of it is doubtful: nothing was lost,
    /// the file is not cut, and it has as many messages as its statistics say.
    pub fn is_lossless(&self) -> bool {
        let whole = self.losses == 0 && self.unchecked == 0 && self.bytes_lost == 0;
        whole && !self.cut && self.lost_messages.known == 0
    }

    fn lose(&mut self, bytes: u64, what: String) {
        self.bytes_lost += bytes;
        self.losses += 1;
        if self.lost.len() < DESCRIBED && self.lost.last() != Some(&what) {
            self.lost.push(what);
        }
    }

    fn note(&mut self, what: String) {
        if self.notes.len() < DESCRIBED && !self.notes.contains(&what) {
            self.notes.push(what);
        }
    }
}

impl fmt::Display for RecoverReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let RecoverReport {
            messages,
            chunks,
            attachments,
            metadata,
            ..
        } = self;
        writeln!(
            f,
            "saved {messages} messages from {chunks} chunks, {attachments} attachments, \
             {metadata} metadata records"
        )?;
        if self.unchecked > 0 {
            let n = self.unchecked;
            writeln!(
                f,
                "  unchecked: {n} of these messages may be other than they were written"
            )?;
        }
        for note in &self.notes {
            writeln!(f, "  note: {}", Shown(note))?;
        }
        for lost in &self.lost {
            writeln!(f, "  lost: {}", Shown(lost))?;
        }
        if self.losses > self.lost.len() as u64 {
            let more = self.losses - self.lost.len() as u64;
            writeln!(f, "  and {more} losses more")?;
        }
        if self.is_lossless() {
            return writeln!(f, "nothing that was in the file is lost");
        }
        let bytes = self.bytes_lost;
        writeln!(f, "{bytes} bytes held nothing that could be used")?;
        if self.cut {
            writeln!(
                f,
                "the file was never finished, or its end is missing: what would have come is not in it"
            )?;
        }
        write!(f, "{}", self.lost_messages)
    }
}

/// Writes every whole record of `broken` to a new file `out`, which is a whole MCAP file whatever
/// `broken` is: also those in chunks that are cut, were never closed or do not match their
/// checksums, and those behind damage. Channels without messages are kept, and schemas and channels
/// that only the summary still has. The new file appears under its name once it is whole.
///
/// ```no_run
/// let report = farside_logs::recover("broken.mcap", "fixed.mcap")?;
/// println!("{} messages saved, {} bytes lost", report.messages, report.bytes_lost);
/// # Ok::<(), farside_logs::LogError>(())
/// ```
///
/// # Errors
/// If `broken` does not even start like an MCAP file, or `out` is the same file by any name, is
/// there and no log, is being written by a run, or cannot be written.
pub fn recover(broken: impl AsRef<Path>, out: impl AsRef<Path>) -> Result<RecoverReport, LogError> {
    let (broken, out) = (broken.as_ref(), out.as_ref());
    let mut source = Source::open(broken)?;
    may_be_written(broken, out)?;
    let _lock = lock_replaced(out)?;
    let hints = Hints::read(&mut source)?;
    // First what is declared anywhere in the file: what a message needs may come behind it.
    let mut known = FirstDeclared::default();
    Salvage::walk(&mut source, hints.clone(), None, &mut |part| {
        known.add(&part);
        Ok(())
    })?;
    let channels: BTreeSet<u16> = known.channels.keys().copied().collect();
    let mut saved = Saved::create(broken, out, known, hints.counted.clone())?;
    let channels = Some(channels);
    Salvage::walk(&mut source, hints, channels, &mut |part| saved.add(part))?;
    saved.finish()
}

/// Refuses to write over the file that is read, by whatever name, and over what is no log.
fn may_be_written(broken: &Path, out: &Path) -> Result<(), LogError> {
    may_hold_log(out, &[broken.to_owned()])?;
    match std::fs::metadata(out) {
        // What is saved is renamed to its place, which a device or folder cannot be.
        Ok(found) if !found.is_file() => Err(LogError::NotWritable {
            path: out.to_owned(),
            what: if found.is_dir() {
                "a folder"
            } else {
                "a pipe or a device"
            },
        }),
        _ => Ok(()),
    }
}

/// What a file declares: for each id, what was declared first under it, preferably where no
/// checksum says that it may be something else.
#[derive(Default)]
struct FirstDeclared {
    schemas: BTreeMap<u16, (Declaration, bool)>,
    channels: BTreeMap<u16, (Declaration, bool)>,
}

impl FirstDeclared {
    fn add(&mut self, part: &Part<'_>) {
        let (of, id, declared, sure) = match part {
            Part::Schema { record, sure, .. } => {
                let declared = Declaration::schema(record);
                (&mut self.schemas, record.id, declared, *sure)
            }
            Part::Channel { record, sure, .. } => {
                let declared = Declaration::channel(record);
                (&mut self.channels, record.id, declared, *sure)
            }
            _ => return,
        };
        let better = of.get(&id).is_none_or(|(_, known)| sure && !known);
        if better {
            of.insert(id, (declared, sure));
        }
    }

    /// What is to be declared under an id where `declared` was read there, surely or not.
    fn surest(
        of: &BTreeMap<u16, (Declaration, bool)>,
        id: u16,
        declared: Declaration,
        sure: bool,
    ) -> Declaration {
        match of.get(&id) {
            Some((known, true)) if !sure => known.clone(),
            _ => declared,
        }
    }
}
