//! Who is the centre: terms, elections and mandates.
//!
//! A rover that supports a term until an instant supports no other before. A candidate that a
//! majority supports has the mandate until the guard before the earliest of these instants, and asks
//! for later ones in time. Any later majority shares a rover with it, so that no two have the mandate
//! at one time, and a new centre knows that everything granted before was granted before its election.

use farside::SimTime;

use super::{Centre, CentreWrite, Office};
use crate::shac::messages::{GoalDigest, Output, Support};
use crate::shac::values::{Party, Term};

impl Centre {
    /// Whether this is the centre now: it may grant, prolong, confirm and take back.
    pub fn is_in_office(&self, now: SimTime) -> bool {
        if self.settings.election.is_none() {
            return self.settings.rank(self.site) == 0;
        }
        let Office { term, elected, .. } = self.durable.office;
        let is_elected = term == elected && term.centre == self.site && term.number > 0;
        is_elected && (now < self.mandate_end() || !self.settings.rules.mandate)
    }

    /// Until when the majority's promises last, less the guard.
    fn mandate_end(&self) -> SimTime {
        let mut promised: Vec<SimTime> = self.rovers.iter().map(|rover| rover.promised).collect();
        promised.sort_unstable_by(|a, b| b.cmp(a));
        let majority = promised[self.rovers.len() / 2];
        let end = majority
            .as_nanos()
            .saturating_sub(self.settings.guard.as_nanos());
        SimTime::from_nanos(end)
    }

    /// Until when this centre has the mandate, as others are told.
    pub(super) fn mandate(&self, now: SimTime) -> SimTime {
        match self.settings.election {
            None => SimTime::MAX,
            Some(_) if self.is_in_office(now) => self.mandate_end(),
            Some(_) => SimTime::ZERO,
        }
    }

    /// Whether nobody can have a lease of an earlier term that this centre does not know of.
    pub fn is_settled(&self, now: SimTime) -> bool {
        now >= self.durable.office.waits_until || self.has_all_reports()
    }

    /// Whether all rovers support this term, and have told what they held when they began to.
    pub(super) fn has_all_reports(&self) -> bool {
        self.rovers.iter().all(|rover| rover.has_reported)
    }

    /// When something of this file is to be done.
    pub(super) fn office_hours(&self) -> impl Iterator<Item = SimTime> {
        let times = self.settings.election.map(|_| {
            let ends = self.seeks.map_or(SimTime::MAX, |seeks| seeks.until);
            [self.stands_at, self.renews_at, ends, self.mandate_end()]
        });
        times.into_iter().flatten()
    }

    /// Keeps the mandate, or asks for one when nobody is heard to have it.
    pub(super) fn stand(&mut self, now: SimTime, out: &mut Output<CentreWrite>) {
        let Some(silence) = self.settings.election else {
            if self.durable.office.term.number == 0 && self.settings.rank(self.site) == 0 {
                let term = self.next_term();
                self.hold_office(term, term, SimTime::ZERO, out);
            }
            return;
        };
        if self.is_in_office(now) {
            if now >= self.renews_at {
                self.renews_at = now + silence_part(silence);
                self.ask(now, self.durable.office.term);
            }
            return;
        }
        if let Some(seeks) = self.seeks {
            if now < seeks.until {
                return;
            }
            // Candidates that were refused together come again at different times.
            self.seeks = None;
            self.stands_at = now + self.settings.stagger * (self.settings.rank(self.site) + 1);
        }
        if now >= self.stands_at {
            let Office { term, elected, .. } = self.durable.office;
            let is_mine = term == elected && term.centre == self.site && term.number > 0;
            let term = if is_mine { term } else { self.next_term() };
            if !is_mine {
                self.step_to(now, term, out);
            }
            self.renews_at = now + silence_part(silence);
            self.ask(now, term);
        }
    }

    fn next_term(&self) -> Term {
        Term {
            number: self.durable.office.term.number + 1,
            centre: self.site,
        }
    }

    /// Asks all rovers for a promise.
    fn ask(&mut self, now: SimTime, term: Term) {
        let Some(silence) = self.settings.election else {
            return;
        };
        let until = now + silence;
        self.seeks = Some(Support { term, until });
        for peer in &mut self.peers[..self.rovers.len()] {
            peer.contact.poke(&self.settings, now);
        }
    }

    fn hold_office(
        &mut self,
        term: Term,
        elected: Term,
        waits_until: SimTime,
        out: &mut Output<CentreWrite>,
    ) {
        let office = Office {
            term,
            elected,
            waits_until,
        };
        self.write(CentreWrite::Office(office), out);
    }

    /// Another term has begun: what was promised for earlier ones does not count. Who has promised to
    /// support this candidate in vain is set free, or two candidates with half of the rovers each
    /// would keep each other out for ever.
    fn step_to(&mut self, now: SimTime, term: Term, out: &mut Output<CentreWrite>) {
        let Office {
            term: before,
            elected,
            waits_until,
        } = self.durable.office;
        self.hold_office(term, elected, waits_until, out);
        if self.seeks.take().is_some() && before != elected {
            self.renounced = Some(before);
            for peer in &mut self.peers[..self.rovers.len()] {
                peer.contact.owes_digest = true;
                peer.contact.poke(&self.settings, now);
            }
        }
        self.auctions.clear();
        for rover in &mut self.rovers {
            rover.promised = SimTime::ZERO;
            rover.has_reported = false;
        }
    }

    /// Takes what a digest says of terms, and of the sender's promise.
    pub(super) fn hear_of_office(
        &mut self,
        now: SimTime,
        from: Party,
        digest: &GoalDigest,
        out: &mut Output<CentreWrite>,
    ) {
        if self.settings.election.is_none() {
            return;
        }
        let mine = self.durable.office.term;
        if digest.term > mine {
            self.step_to(now, digest.term, out);
        }
        if digest.term.centre != self.site && digest.until > now {
            self.let_others_go_first(now, from, digest.until, out);
        }
        let (Party::Owner(rover), Some(support)) = (from, digest.supports) else {
            return;
        };
        if support.term != self.durable.office.term || support.term.centre != self.site {
            return;
        }
        let rover = &mut self.rovers[rover as usize];
        rover.promised = rover.promised.max(support.until);
        rover.has_reported = true;
        self.count_votes(now, out);
    }

    /// There is another centre, or a rover has promised its support to one.
    fn let_others_go_first(
        &mut self,
        now: SimTime,
        from: Party,
        until: SimTime,
        out: &mut Output<CentreWrite>,
    ) {
        let free_at = match from {
            Party::Centre(_) => until,
            Party::Owner(rover) => {
                self.rovers[rover as usize].bound = until;
                let mut bound: Vec<SimTime> = self.rovers.iter().map(|rover| rover.bound).collect();
                bound.sort_unstable();
                bound[self.rovers.len() / 2]
            }
        };
        if free_at > now {
            let rank = self.settings.rank(self.site) + 1;
            let then = free_at + self.settings.stagger * rank;
            self.stands_at = self.stands_at.max(then);
            let Office { term, elected, .. } = self.durable.office;
            if self.seeks.is_some() && term != elected {
                self.step_to(now, self.next_term(), out);
            }
        }
    }

    /// The latest term that somebody else has to know of: not one that this centre only stands for.
    pub(super) fn term_to_tell(&self) -> Term {
        let Office { term, elected, .. } = self.durable.office;
        if term.centre == self.site {
            elected
        } else {
            term
        }
    }

    /// A status says which term its rover supports.
    pub(super) fn hear_report(&mut self, rover: u32, term: Term) {
        let mine = self.durable.office.term;
        if term == mine && mine.centre == self.site {
            self.rovers[rover as usize].has_reported = true;
        }
    }

    fn count_votes(&mut self, now: SimTime, out: &mut Output<CentreWrite>) {
        let Office { term, elected, .. } = self.durable.office;
        if elected == term || now >= self.mandate_end() {
            return;
        }
        let waits_until = match self.settings.protocol.lease {
            _ if !self.settings.rules.wait_out => SimTime::ZERO,
            None => SimTime::MAX,
            Some(lease) => now + lease + self.settings.guard,
        };
        self.hold_office(term, term, waits_until, out);
        for index in 0..self.peers.len() {
            let peer = &mut self.peers[index];
            peer.contact.owes_digest = true;
            peer.contact.poke(&self.settings, now);
        }
    }
}

/// How long before a promise ends the next is asked for: two thirds of it.
fn silence_part(silence: farside::SimDuration) -> farside::SimDuration {
    farside::SimDuration::from_nanos(silence.as_nanos() / 3)
}
