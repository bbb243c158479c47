//! The centre's side of the protocol: who has which goal, and who may get it.

mod durable;
mod govern;
mod office;
mod receive;
mod send;
mod wishes;

use std::collections::BTreeMap;
use std::sync::Arc;

use farside::{SimDuration, SimTime};

use super::contact::Contact;
use super::messages::{Held, Message, Output, Support};
use super::record::{GoalRecord, Standing};
use super::settings::Settings;
use super::values::{GoalKey, Grant, Party, Revision, Term, Version};
pub use durable::{CentreDurable, CentreWrite, Office};
pub use govern::{AssignError, Vacancy};
pub use wishes::WishError;

/// The centre's side of the protocol, or one that may become it. See [the module](super) for an
/// example.
#[derive(Clone, Debug)]
pub struct Centre {
    settings: Arc<Settings>,
    site: u32,
    durable: CentreDurable,
    parties: Vec<Party>,
    peers: Vec<Peer>,
    rovers: Vec<Rover>,
    /// When each record was last changed, counted in changes.
    changed: BTreeMap<GoalKey, u32>,
    changes: u32,
    /// When it started.
    started: SimTime,
    /// What owners have told of goals that this centre has no record of.
    strangers: BTreeMap<GoalKey, Vec<(u32, Held)>>,
    auctions: BTreeMap<GoalKey, Auction>,
    /// What it asks rovers to promise.
    seeks: Option<Support>,
    /// The last term for which it stood in vain.
    renounced: Option<Term>,
    /// When it stands for the office, unless it hears of a centre.
    stands_at: SimTime,
    /// When it asks for the next promise.
    renews_at: SimTime,
}

/// What a centre knows of another party.
#[derive(Clone, Debug)]
struct Peer {
    contact: Contact,
    /// Of another centre: which of this one's changes it has.
    has_records: Version,
}

/// What a centre knows of a rover, besides what it has of each goal.
#[derive(Clone, Debug, Default)]
struct Rover {
    /// The highest version of its status that came.
    version: Option<Version>,
    /// See [`GoalStatus::capacity`](super::GoalStatus::capacity).
    capacity: u32,
    /// When a status last came.
    heard: Option<SimTime>,
    /// Until when it supports this centre's term.
    promised: SimTime,
    /// Until when it supports another centre's term.
    bound: SimTime,
    /// Whether it has told all that it has since it supports this term.
    has_reported: bool,
    /// What it has acknowledged of each goal.
    told: BTreeMap<GoalKey, Told>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Told {
    grant: Grant,
    lease_end: SimTime,
    confirmed: bool,
    revision: Revision,
}

/// Bids for a goal, as far as they have come.
#[derive(Clone, Debug)]
struct Auction {
    until: SimTime,
    /// Who is asked, ascending, and what it has answered.
    bids: Vec<(u32, Option<Option<f64>>)>,
}

impl Centre {
    /// Starts the centre of a site, with what is left of an earlier one in durable memory. The site has
    /// to be among the candidates.
    pub fn start(
        settings: Arc<Settings>,
        site: u32,
        durable: CentreDurable,
        now: SimTime,
    ) -> (Centre, Output<CentreWrite>) {
        let parties = settings.parties();
        let peer = || Peer {
            contact: Contact::new(&settings, now),
            has_records: Version::default(),
        };
        let peers = parties.iter().map(|_| peer()).collect();
        let rank = settings.rank(site);
        // Who was elected before it crashed stands at once: rovers may still be bound to its term.
        let Office { term, elected, .. } = durable.office;
        let was_elected = term == elected && term.centre == site && term.number > 0;
        let patience = match settings.election {
            Some(silence) if rank > 0 && !was_elected => silence + settings.stagger * rank,
            _ => SimDuration::ZERO,
        };
        let changed: BTreeMap<GoalKey, u32> = durable.table.keys().copied().zip(1..).collect();
        let changes = changed.len() as u32;
        let mut centre = Centre {
            site,
            parties,
            peers,
            rovers: vec![Rover::default(); settings.rovers as usize],
            changed,
            changes,
            started: now,
            strangers: BTreeMap::new(),
            auctions: BTreeMap::new(),
            seeks: None,
            renounced: None,
            stands_at: now + patience,
            renews_at: now,
            settings,
            durable,
        };
        let mut out = Output::default();
        let incarnation = centre.durable.incarnation + 1;
        centre.write(CentreWrite::Started { incarnation }, &mut out);
        centre.finish(now, &mut out);
        (centre, out)
    }

    /// What is written.
    pub fn durable(&self) -> &CentreDurable {
        &self.durable
    }

    /// What all participants know.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// How a goal stands; none if this centre has never been told of it.
    pub fn standing(&self, goal: GoalKey) -> Option<Standing> {
        let record = self.durable.table.get(&goal)?;
        Some(record.standing(&self.durable.outcomes))
    }

    /// All goals and how they stand, in the order of their names.
    pub fn standings(&self) -> impl Iterator<Item = (GoalKey, Standing)> {
        let records = self.durable.table.iter();
        records.map(|(&goal, record)| (goal, record.standing(&self.durable.outcomes)))
    }

    /// When a status of a rover last came.
    pub fn heard(&self, rover: u32) -> Option<SimTime> {
        self.rovers.get(rover as usize)?.heard
    }

    /// Time has passed: at the instant of [`Centre::wake`], or at any other.
    pub fn tick(&mut self, now: SimTime) -> Output<CentreWrite> {
        let mut out = Output::default();
        self.finish(now, &mut out);
        out
    }

    /// When [`Centre::tick`] has to be called at the latest.
    pub fn wake(&self, now: SimTime) -> SimTime {
        let guard = self.settings.guard;
        let holders = self
            .durable
            .table
            .values()
            .filter_map(|record| record.holder);
        let ends = holders.map(|holder| holder.lease_end.saturating_add(guard));
        let auctions = self.auctions.values().map(|auction| auction.until);
        let sol = self.settings.sol * (self.settings.sol_of(now) + 1);
        let others = [self.durable.office.waits_until, SimTime::ZERO + sol];
        let due = self.peers.iter().filter_map(|peer| peer.contact.due);
        let due = due.filter_map(|due| self.settings.windows.next_open(due.max(now)));
        let all = ends
            .chain(auctions)
            .chain(others)
            .chain(self.office_hours());
        let later = all.filter(|&at| at > now);
        later.chain(due).min().unwrap_or(SimTime::MAX)
    }
}

/// What all calls end with.
impl Centre {
    fn write(&mut self, write: CentreWrite, out: &mut Output<CentreWrite>) {
        self.durable.apply(&write);
        let is_kept = self.settings.rules.write_first || !matches!(write, CentreWrite::Goal(_));
        if is_kept {
            out.writes.push(write);
        }
    }

    /// Writes a record, if it has changed, and tells whom it concerns.
    fn keep(&mut self, now: SimTime, record: GoalRecord, out: &mut Output<CentreWrite>) {
        let key = record.wish.goal.key;
        if self.durable.table.get(&key) == Some(&record) {
            return;
        }
        let before = self
            .durable
            .table
            .get(&key)
            .and_then(|before| before.holder);
        let concerned = [before, record.holder];
        self.write(CentreWrite::Goal(record), out);
        self.changes += 1;
        self.changed.insert(key, self.changes);
        for holder in concerned.into_iter().flatten() {
            self.peers[holder.rover as usize]
                .contact
                .poke(&self.settings, now);
        }
        for index in self.settings.rovers as usize..self.peers.len() {
            self.peers[index].contact.poke(&self.settings, now);
        }
    }

    fn me(&self) -> Party {
        Party::Centre(self.site)
    }

    /// Sends something at once, if anything may be sent. If not, who asked asks again.
    fn reply(&self, now: SimTime, to: Party, message: Message, out: &mut Output<CentreWrite>) {
        if self.settings.windows.is_open(now) {
            out.sends.push((to, message));
        }
    }

    fn finish(&mut self, now: SimTime, out: &mut Output<CentreWrite>) {
        self.stand(now, out);
        self.govern(now, out);
        if self.settings.windows.is_open(now) {
            for index in 0..self.peers.len() {
                self.flush(now, index, out);
            }
        }
    }
}
