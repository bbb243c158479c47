//! How rovers come to hold the same readings, whatever links lose.
//!
//! What is exchanged is the row of each reading: a set keyed by the reading's id, in which the later
//! version replaces the earlier. Joining two such sets is commutative, associative and idempotent,
//! so nothing is counted twice, in whatever order and however often messages come.
//!
//! # Which rows a message holds
//!
//! Each origin numbers its writes, new readings and corrections alike, from 1; a row's version is the
//! number of its last write. A rover keeps for each origin through which write it has them all, and
//! for each peer what that peer has said it has. A message to a peer holds, for each origin, the
//! rows between the two, and what the sender has, which acknowledges. So a row is repeated until
//! its receipt is known and no longer; rows of others are passed on, which makes partitions, joining
//! and leaving nothing special. A rover that restarts without its rows calls itself by a new
//! incarnation; what its earlier one was known to have is forgotten by those who hear the new one.
//!
//! # Why rows, and not sums over a model
//!
//! Distributed expectation maximisation is often done by exchanging, for each component of a
//! common model, sums of responsibilities, features and their squares. Such sums hold for that model
//! only: they have to be sent again for each step, each start and each number of components. Where
//! two rovers read the same rock, or a reading is corrected, the sums of both cannot be
//! disentangled. Rows are sent once, whatever is learnt from them later.
//! `cargo run -p farside-misus --example exchange_bytes` compares the bytes of both.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::reading::{Origin, Reading, ReadingError, ReadingId, Row};

/// How many rows a message holds at most, unless said otherwise: some 4 kB.
pub const ROWS_PER_MESSAGE: usize = 64;

/// A message from one rover to another: rows that the other may lack, and what the sender has.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Statistics {
    /// Who sends it.
    pub from: Origin,
    /// The incarnation of the recipient that the sender has last heard from.
    pub heard: Option<u32>,
    /// Whether the sender wants to be told that this came: it holds rows, or the sender does not know
    /// yet that its incarnation was heard.
    pub answer: bool,
    /// Through which write of each origin the sender has all rows. Origins ascend.
    pub have: Vec<Has>,
    /// Rows, by origin. Origins ascend.
    pub spans: Vec<Span>,
}

impl Statistics {
    /// How many rows it holds.
    pub fn rows(&self) -> usize {
        self.spans.iter().map(|span| span.rows.len()).sum()
    }
}

/// Through which write of an origin somebody has all rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Has {
    /// Whose rows.
    pub origin: Origin,
    /// The number of the last write, from 1.
    pub through: u32,
}

/// All rows of an origin that were last written within a range. Rows written in the range and
/// again after it are not among them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Span {
    /// Whose rows.
    pub origin: Origin,
    /// The range begins after this write; 0 is before the first.
    pub after: u32,
    /// The last write of the range.
    pub through: u32,
    /// The rows. Versions ascend.
    pub rows: Vec<SpanRow>,
}

/// A row without its origin, which the span says.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SpanRow {
    /// See [`ReadingId::ordinal`].
    pub ordinal: u32,
    /// See [`Row::version`].
    pub version: u32,
    /// What was read.
    pub reading: Reading,
}

/// What a message changed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Received {
    /// Rows of readings that were not known.
    pub added: usize,
    /// Rows that replaced an earlier version.
    pub revised: usize,
    /// Rows that were known already.
    pub known: usize,
    /// Rows that were not taken, since earlier ones are missing; they will be sent again.
    pub early: usize,
}

/// Why a reading or a message is refused. Nothing of it is taken.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ExchangeError {
    /// A reading that no instrument gives.
    #[error(transparent)]
    Reading(#[from] ReadingError),
    /// Only who made a reading may correct it, and only before it restarts.
    #[error("{actual:?} may not correct a reading of {expected:?}")]
    NotMine {
        /// Whose reading it is.
        expected: Origin,
        /// Who wants to correct it.
        actual: Origin,
    },
    /// There is no such reading.
    #[error("no reading {id:?} to correct; {written} were made")]
    Unknown {
        /// The reading's name.
        id: ReadingId,
        /// How many readings there are of this origin.
        written: u32,
    },
    /// A row lies outside the range of writes that its span says.
    #[error("a row of {origin:?} has version {actual}, must be over {after} and at most {through}")]
    Version {
        /// Whose row.
        origin: Origin,
        /// Its version.
        actual: u32,
        /// Where the range begins.
        after: u32,
        /// Where it ends.
        through: u32,
    },
    /// Somebody has writes of this rover that it did not make: two rovers have one name, or a
    /// restarted one took an incarnation again.
    #[error("{from:?} has write {actual} of {origin:?}, which has made {expected}")]
    Impostor {
        /// Who says so.
        from: Origin,
        /// This rover.
        origin: Origin,
        /// How many writes it has made.
        expected: u32,
        /// Which one the other has.
        actual: u32,
    },
}

/// Through which write of each origin all rows are there.
type Vector = BTreeMap<Origin, u32>;

/// What is known of a peer.
#[derive(Clone, Debug, Default)]
struct Peer {
    /// Its latest incarnation that was heard from.
    incarnation: Option<u32>,
    /// What it has said it has.
    have: Vector,
    /// Whether it has said that it heard this rover's incarnation.
    has_heard: bool,
    /// Whether it waits to be told what this rover has.
    is_owed: bool,
    /// The origin whose rows came last in the latest message that was cut.
    cut_at: Option<Origin>,
}

/// A rover's rows, and what its peers are known to have.
///
/// ```
/// use farside_misus::analysis::exchange::Exchange;
/// use farside_misus::analysis::reading::{Origin, Reading};
///
/// let mut a = Exchange::new(Origin { rover: 0, incarnation: 0 });
/// let mut b = Exchange::new(Origin { rover: 1, incarnation: 0 });
/// let reading = Reading { rock: 7, position_m: [1.0, 2.0], ..Reading::default() };
/// let id = a.record(reading)?;
///
/// let lost = a.offer(1).expect("a row that rover 1 lacks");
/// let again = a.offer(1).expect("the same row, since nothing was acknowledged");
/// assert_eq!(lost, again);
/// b.receive(&again)?;
/// let acknowledgement = b.offer(0).expect("rover 0 does not know yet that it came");
/// a.receive(&acknowledgement)?;
/// a.revise(id, Reading { position_m: [1.1, 2.0], ..reading })?;
/// let correction = a.offer(1).expect("a later version");
/// b.receive(&correction)?;
/// assert!(a.rows().eq(b.rows()));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Exchange {
    me: Origin,
    rows_per_message: usize,
    rows: BTreeMap<ReadingId, Row>,
    /// The ordinals of `rows` by origin and version.
    written: BTreeMap<(Origin, u32), u32>,
    have: Vector,
    /// How many readings this rover has made.
    readings: u32,
    peers: BTreeMap<u32, Peer>,
}

impl Exchange {
    /// A rover that has no rows yet. After a restart without memory it needs an incarnation that it
    /// had never before.
    pub fn new(me: Origin) -> Exchange {
        Exchange {
            me,
            rows_per_message: ROWS_PER_MESSAGE,
            rows: BTreeMap::new(),
            written: BTreeMap::new(),
            have: Vector::new(),
            readings: 0,
            peers: BTreeMap::new(),
        }
    }

    /// With messages of at most this many rows, at least 1.
    #[must_use]
    pub fn with_rows_per_message(mut self, rows: usize) -> Exchange {
        self.rows_per_message = rows.max(1);
        self
    }

    /// Who this is.
    pub fn origin(&self) -> Origin {
        self.me
    }

    /// All rows, of this rover and of others, in the order of their ids.
    pub fn rows(&self) -> impl ExactSizeIterator<Item = &Row> + Clone {
        self.rows.values()
    }

    /// The row of a reading, if it is known.
    pub fn row(&self, id: ReadingId) -> Option<&Row> {
        self.rows.get(&id)
    }

    /// Adds a reading of this rover's, and names it.
    ///
    /// # Errors
    /// When the reading has numbers that no instrument gives; nothing is added then.
    pub fn record(&mut self, reading: Reading) -> Result<ReadingId, ExchangeError> {
        reading.check()?;
        let id = ReadingId {
            origin: self.me,
            ordinal: self.readings,
        };
        self.readings += 1;
        self.write(id, reading);
        Ok(id)
    }

    /// Corrects a reading of this rover's, as when it learns where it was.
    ///
    /// # Errors
    /// When the reading is not this incarnation's, or has numbers that no instrument gives.
    pub fn revise(&mut self, id: ReadingId, reading: Reading) -> Result<(), ExchangeError> {
        reading.check()?;
        if id.origin != self.me {
            return Err(ExchangeError::NotMine {
                expected: id.origin,
                actual: self.me,
            });
        }
        match self.rows.get(&id) {
            None => Err(ExchangeError::Unknown {
                id,
                written: self.readings,
            }),
            Some(row) if row.reading == reading => Ok(()),
            Some(_) => {
                self.write(id, reading);
                Ok(())
            }
        }
    }

    fn write(&mut self, id: ReadingId, reading: Reading) {
        let version = self.have.get(&self.me).map_or(1, |through| through + 1);
        self.have.insert(self.me, version);
        self.join(Row {
            id,
            version,
            reading,
        });
    }

    /// Takes a row, unless a later version is known. Which of two rows counts depends on nothing
    /// but the two.
    fn join(&mut self, row: Row) -> Joined {
        let joined = match self.rows.get(&row.id) {
            None => Joined::Added,
            Some(known) => {
                let order = (known.version.cmp(&row.version))
                    .then_with(|| known.reading.cmp_bits(&row.reading));
                if order.is_ge() {
                    return Joined::Known;
                }
                self.written.remove(&(row.id.origin, known.version));
                Joined::Revised
            }
        };
        self.written
            .insert((row.id.origin, row.version), row.id.ordinal);
        self.rows.insert(row.id, row);
        joined
    }

    /// What to send to a peer: rows that it is not known to have, and what this rover has. `None` if
    /// the peer has said that it has everything, and needs no acknowledgement.
    ///
    /// Rows that no acknowledgement has come for are offered again at each call, so it is called
    /// for peers that may be within reach, once a round.
    pub fn offer(&mut self, peer: u32) -> Option<Statistics> {
        let mut state = self.peers.remove(&peer).unwrap_or_default();
        let spans = self.spans_for(&mut state);
        let answer = !spans.is_empty() || !state.has_heard;
        let needed = answer || state.is_owed;
        state.is_owed = false;
        let heard = state.incarnation;
        self.peers.insert(peer, state);
        let have = self.have.iter();
        needed.then(|| Statistics {
            from: self.me,
            heard,
            answer,
            have: have
                .map(|(&origin, &through)| Has { origin, through })
                .collect(),
            spans,
        })
    }

    /// The rows that a peer is not known to have, as many as a message holds. If that is not all,
    /// the next message begins where this one was cut, so that no origin waits for ever.
    fn spans_for(&self, peer: &mut Peer) -> Vec<Span> {
        let first = peer.cut_at.take();
        let later = self
            .have
            .iter()
            .filter(|(origin, _)| first <= Some(**origin));
        let earlier = self
            .have
            .iter()
            .filter(|(origin, _)| first > Some(**origin));
        let mut room = self.rows_per_message;
        let mut spans = Vec::new();
        for (&origin, &through) in later.chain(earlier) {
            let after = peer.have.get(&origin).copied().unwrap_or(0);
            if after >= through {
                continue;
            }
            let mut span = Span {
                origin,
                after,
                through,
                rows: Vec::new(),
            };
            let written = self.written.range((origin, after + 1)..=(origin, through));
            for (&(_, version), &ordinal) in written {
                if room == 0 {
                    // What was taken so far is complete up to the row before this one.
                    span.through = span.rows.last().map_or(after, |row| row.version);
                    peer.cut_at = Some(origin);
                    break;
                }
                room -= 1;
                let reading = self.rows[&ReadingId { origin, ordinal }].reading;
                span.rows.push(SpanRow {
                    ordinal,
                    version,
                    reading,
                });
            }
            if span.through > after {
                spans.push(span);
            }
            if peer.cut_at.is_some() {
                break;
            }
        }
        spans.sort_by_key(|span| span.origin);
        spans
    }

    /// Takes a message of another rover.
    ///
    /// # Errors
    /// When the message contradicts itself, holds numbers that no instrument gives, or rows of this
    /// rover that it did not write. Nothing of it is taken then.
    pub fn receive(&mut self, message: &Statistics) -> Result<Received, ExchangeError> {
        self.check(message)?;
        let mut received = Received::default();
        for span in &message.spans {
            let through = self.have.get(&span.origin).copied().unwrap_or(0);
            if span.after > through {
                // The sender thinks of what this rover had before it restarted. Rows behind a gap
                // could not be passed on; they come again once the sender knows.
                received.early += span.rows.len();
                continue;
            }
            for row in &span.rows {
                let id = ReadingId {
                    origin: span.origin,
                    ordinal: row.ordinal,
                };
                let (version, reading) = (row.version, row.reading);
                match self.join(Row {
                    id,
                    version,
                    reading,
                }) {
                    Joined::Added => received.added += 1,
                    Joined::Revised => received.revised += 1,
                    Joined::Known => received.known += 1,
                }
            }
            self.have.insert(span.origin, through.max(span.through));
        }
        self.learn_of(message);
        Ok(received)
    }

    /// Keeps what a message says of its sender.
    fn learn_of(&mut self, message: &Statistics) {
        let peer = self.peers.entry(message.from.rover).or_default();
        if peer.incarnation < Some(message.from.incarnation) {
            *peer = Peer {
                incarnation: Some(message.from.incarnation),
                ..Peer::default()
            };
        } else if peer.incarnation > Some(message.from.incarnation) {
            // A late message from before a restart says nothing of what the rover has now.
            return;
        }
        peer.has_heard |= message.heard == Some(self.me.incarnation);
        peer.is_owed |= message.answer;
        for has in &message.have {
            let through = peer.have.entry(has.origin).or_default();
            *through = has.through.max(*through);
        }
    }

    fn check(&self, message: &Statistics) -> Result<(), ExchangeError> {
        let own = self.have.get(&self.me).copied().unwrap_or(0);
        let said = message.have.iter().map(|has| (has.origin, has.through));
        let sent = message.spans.iter().map(|span| (span.origin, span.through));
        if let Some((origin, actual)) = said.chain(sent).find(|&(o, w)| o == self.me && w > own) {
            return Err(ExchangeError::Impostor {
                from: message.from,
                origin,
                expected: own,
                actual,
            });
        }
        for span in &message.spans {
            let mut before = span.after;
            for row in &span.rows {
                if row.version <= before || row.version > span.through {
                    return Err(ExchangeError::Version {
                        origin: span.origin,
                        actual: row.version,
                        after: before,
                        through: span.through,
                    });
                }
                before = row.version;
                row.reading.check()?;
            }
        }
        Ok(())
    }
}

/// What became of a row.
enum Joined {
    Added,
    Revised,
    Known,
}

#[cfg(test)]
mod tests;
