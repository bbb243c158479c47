//! The front of two logs, as long as both say the same in the same order: nothing is kept of it.

use super::entry::{Entry, Mode, Names};
use super::index::Index;
use mcap::records::MessageHeader;

use crate::LogError;
use crate::channel::ChannelInfo;

/// Reads both logs up to where they cease to agree, and keeps the first records that do not. Gives
/// how many of those that agree have another sequence number.
pub(super) fn front(
    a: &mut Index<'_>,
    b: &mut Index<'_>,
    mode: Mode,
    names: &mut Names,
) -> Result<u64, LogError> {
    let mut front = Front {
        mode,
        renumbered: 0,
        declared_alike: Vec::new(),
    };
    loop {
        let x = a.advance(names)?;
        let y = match b.advance(names) {
            Ok(y) => y,
            // What is wrong with the first file is said first, wherever it is.
            Err(error) => return Err(first_error(a, x, names).err().unwrap_or(error)),
        };
        let (records_a, records_b) = (a.records - u32::from(x), b.records - u32::from(y));
        let (entry_a, entry_b) = match (x, y) {
            (true, true) => match front.disagree(a, b, names)? {
                Some((entry_a, entry_b)) => (Some(entry_a), Some(entry_b)),
                None => continue,
            },
            (true, false) => (Some(a.entry(names)?), None),
            (false, true) => (None, Some(b.entry(names)?)),
            (false, false) => (None, None),
        };
        a.agrees_until(records_a);
        b.agrees_until(records_b);
        b.keys_agree_with(a);
        entry_a.map_or(Ok(()), |entry| a.keep(entry))?;
        entry_b.map_or(Ok(()), |entry| b.keep(entry))?;
        return Ok(front.renumbered);
    }
}

/// What is wrong with the rest of a log, from a message that it may be at.
fn first_error(log: &mut Index<'_>, mut at: bool, names: &mut Names) -> Result<(), LogError> {
    while at {
        log.entry(names)?;
        at = log.advance(names)?;
    }
    Ok(())
}

struct Front {
    mode: Mode,
    renumbered: u64,
    /// For each channel of the first log, one of the second that was compared with it, and whether
    /// both are declared alike.
    declared_alike: Vec<Option<(u32, bool)>>,
}

impl Front {
    /// The entries of the two records that the logs are at; `None` if they agree.
    fn disagree(
        &mut self,
        a: &mut Index<'_>,
        b: &mut Index<'_>,
        names: &mut Names,
    ) -> Result<Option<(Entry, Entry)>, LogError> {
        let (Some(x), Some(y)) = (a.current(), b.current()) else {
            return Ok(None);
        };
        let alike = a.topic() == b.topic() && self.are_alike(x.channel, y.channel);
        let times = |head: &MessageHeader| (head.log_time, head.publish_time);
        // Of Farside's records the bytes have all that is compared.
        let same =
            x.data == y.data && (self.mode == Mode::Farside || times(&x.head) == times(&y.head));
        let renumbered = self.mode == Mode::Any && x.head.sequence != y.head.sequence;
        if alike && same {
            if a.pass()? {
                b.pass()?;
            }
            self.renumbered += u64::from(renumbered);
            return Ok(None);
        }
        let entry_a = a.entry(names)?;
        let entry_b = match b.entry(names) {
            Ok(entry) => entry,
            Err(error) => return Err(first_error(a, true, names).err().unwrap_or(error)),
        };
        if alike && entry_a.agrees(&entry_b) {
            a.note_key();
            self.renumbered += u64::from(renumbered);
            return Ok(None);
        }
        Ok(Some((entry_a, entry_b)))
    }

    /// Whether what two channels say can be compared by its bytes.
    fn are_alike(&mut self, a: &ChannelInfo, b: &ChannelInfo) -> bool {
        let at = a.serial as usize;
        if self.declared_alike.len() <= at {
            self.declared_alike.resize(at + 1, None);
        }
        if let Some((serial, alike)) = self.declared_alike[at]
            && serial == b.serial
        {
            return alike;
        }
        let schema = |channel: &ChannelInfo| {
            let schema = channel.schema.clone()?;
            Some((
                schema.name.clone(),
                schema.encoding.clone(),
                schema.data.clone(),
            ))
        };
        let alike = a.encoding == b.encoding && schema(a) == schema(b);
        self.declared_alike[at] = Some((b.serial, alike));
        alike
    }
}
