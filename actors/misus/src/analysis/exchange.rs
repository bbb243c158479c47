//! How rovers come to hold the same readings, whatever links lose.
//!
//! What is exchanged is the row of each reading: a set keyed by the reading's id, in which the later
//! version replaces the earlier. Joining two such sets is commutative, associative and idempotent,
//! so nothing is counted twice, in whatever order and however often messages come.
//!
//! # Which rows a message holds
//!
//! Each origin numbers its writes, new readings and corrections alike, from 1; a row's version is the
//! number of its last write. A rover keeps the writes of each origin from the first on without gaps,
//! and for each peer through which write of each origin that peer has said it has them. A message to
//! a peer holds the writes between the two, as many as fit, and what the sender has, which
//! acknowledges. So a write is repeated until its receipt is known and no longer; those of others are
//! passed on, which makes partitions, joining and leaving nothing special. A rover that restarts
//! without its rows calls itself by a new incarnation; what its earlier one was known to have is
//! forgotten by those who hear the new one.
//!
//! What a rover has is thus told by one number for each origin, and rovers with equal numbers have
//! equal rows. This is why writes that a later one replaces are passed on too: left out, a rover
//! that received half of a long message would lack a row that it is thought to have, and if the
//! sender is never heard again, no one would give it.
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

/// How many writes a message holds at most, unless said otherwise: some 5 kB.
pub const WRITES_PER_MESSAGE: usize = 64;

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
    /// How many writes of each origin the sender has, from the first on. Origins ascend.
    pub have: Vec<Has>,
    /// Writes, by origin. Origins ascend.
    pub spans: Vec<Span>,
}

impl Statistics {
    /// How many writes it holds.
    pub fn writes(&self) -> usize {
        self.spans.iter().map(|span| span.writes.len()).sum()
    }
}

/// How many writes of an origin somebody has, from the first on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Has {
    /// Whose rows.
    pub origin: Origin,
    /// The number of the last write, from 1.
    pub through: u32,
}

/// Consecutive writes of an origin.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Span {
    /// Whose writes.
    pub origin: Origin,
    /// How many writes came before these.
    pub after: u32,
    /// The writes, in order.
    pub writes: Vec<Write>,
}

impl Span {
    /// The number of the last write.
    fn through(&self) -> u64 {
        u64::from(self.after) + self.writes.len() as u64
    }
}

/// A reading of an origin, new or corrected.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Write {
    /// See [`ReadingId::ordinal`].
    pub ordinal: u32,
    /// What was read.
    pub reading: Reading,
}

/// What a message changed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Received {
    /// Readings that were not known.
    pub added: usize,
    /// Corrections of readings that were.
    pub revised: usize,
    /// Writes that were known already.
    pub known: usize,
    /// Writes that were not taken, since earlier ones are missing; they will be sent again.
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
    /// A number of writes that nobody can have made.
    #[error("writes of {origin:?} end at {actual}, must end at {limit} at most")]
    TooMany {
        /// Whose writes.
        origin: Origin,
        /// The most.
        limit: u32,
        /// The last one's number.
        actual: u64,
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
        actual: u64,
    },
}

/// How many writes of each origin somebody has: all from the first on.
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
    writes_per_message: usize,
    /// The writes of each origin, from the first on.
    writes: BTreeMap<Origin, Vec<Write>>,
    /// The last write of each reading.
    rows: BTreeMap<ReadingId, Row>,
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
            writes_per_message: WRITES_PER_MESSAGE,
            writes: BTreeMap::new(),
            rows: BTreeMap::new(),
            readings: 0,
            peers: BTreeMap::new(),
        }
    }

    /// With messages of at most this many writes, at least 1.
    #[must_use]
    pub fn with_writes_per_message(mut self, writes: usize) -> Exchange {
        self.writes_per_message = writes.max(1);
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
        self.append(id, reading);
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
                self.append(id, reading);
                Ok(())
            }
        }
    }

    /// How many writes of an origin there are.
    fn has(&self, origin: Origin) -> u32 {
        // No origin makes more writes than a number has; messages that say so are refused.
        self.writes
            .get(&origin)
            .map_or(0, |writes| writes.len() as u32)
    }

    /// Adds the next write of an origin. Whether the reading was not known before.
    fn append(&mut self, id: ReadingId, reading: Reading) -> bool {
        let ordinal = id.ordinal;
        let writes = self.writes.entry(id.origin).or_default();
        writes.push(Write { ordinal, reading });
        let version = writes.len() as u32;
        let row = Row {
            id,
            version,
            reading,
        };
        self.rows.insert(id, row).is_none()
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
        let have = self.writes.iter();
        needed.then(|| Statistics {
            from: self.me,
            heard,
            answer,
            have: have
                .map(|(&origin, writes)| Has {
                    origin,
                    through: writes.len() as u32,
                })
                .collect(),
            spans,
        })
    }

    /// The writes that a peer is not known to have, as many as a message holds. If that is not all, the
    /// next message begins where this one was cut, so that no origin waits for ever.
    fn spans_for(&self, peer: &mut Peer) -> Vec<Span> {
        let first = peer.cut_at.take();
        let later = self
            .writes
            .iter()
            .filter(|(origin, _)| first <= Some(**origin));
        let earlier = self
            .writes
            .iter()
            .filter(|(origin, _)| first > Some(**origin));
        let mut room = self.writes_per_message;
        let mut spans = Vec::new();
        for (&origin, writes) in later.chain(earlier) {
            let after = peer.have.get(&origin).copied().unwrap_or(0);
            let lacking = writes.get(after as usize..).unwrap_or_default();
            let sent = &lacking[..lacking.len().min(room)];
            if !sent.is_empty() {
                room -= sent.len();
                spans.push(Span {
                    origin,
                    after,
                    writes: sent.to_vec(),
                });
            }
            if sent.len() < lacking.len() {
                peer.cut_at = Some(origin);
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
            let known = self.has(span.origin).saturating_sub(span.after) as usize;
            if span.after > self.has(span.origin) {
                // The sender thinks of what this rover had before it restarted. What is behind the
                // gap comes again once the sender knows.
                received.early += span.writes.len();
                continue;
            }
            received.known += known.min(span.writes.len());
            for write in span.writes.iter().skip(known) {
                let id = ReadingId {
                    origin: span.origin,
                    ordinal: write.ordinal,
                };
                match self.append(id, write.reading) {
                    true => received.added += 1,
                    false => received.revised += 1,
                }
            }
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
        let own = self.has(self.me);
        let said = message
            .have
            .iter()
            .map(|has| (has.origin, u64::from(has.through)));
        let sent = message
            .spans
            .iter()
            .map(|span| (span.origin, span.through()));
        for (origin, actual) in said.chain(sent) {
            if origin == self.me && actual > u64::from(own) {
                return Err(ExchangeError::Impostor {
                    from: message.from,
                    origin,
                    expected: own,
                    actual,
                });
            }
            if actual > u64::from(u32::MAX) {
                let limit = u32::MAX;
                return Err(ExchangeError::TooMany {
                    origin,
                    limit,
                    actual,
                });
            }
        }
        let mut writes = message.spans.iter().flat_map(|span| &span.writes);
        Ok(writes.try_for_each(|write| write.reading.check())?)
    }
}

#[cfg(test)]
mod tests;
