//! When to send to somebody again: at once when there is news, then at growing distances until it is
//! acknowledged.

use farside::{SimDuration, SimTime};

use super::settings::Settings;

/// The state of sending to one party, and what outcomes it is known to have.
#[derive(Clone, Debug)]
pub(super) struct Contact {
    /// When to send what is not acknowledged; none when nothing waits.
    pub(super) due: Option<SimTime>,
    delay: SimDuration,
    /// When it was last heard from.
    pub(super) heard: Option<SimTime>,
    /// How many outcomes of each rover it has said it has.
    pub(super) has: Vec<u32>,
    /// Whether it has answered a digest since this machine started.
    pub(super) has_met: bool,
    /// Whether it is owed a digest.
    pub(super) owes_digest: bool,
}

impl Contact {
    pub(super) fn new(settings: &Settings, now: SimTime) -> Contact {
        Contact {
            due: Some(now),
            delay: settings.resend_first,
            heard: None,
            has: vec![0; settings.rovers as usize],
            has_met: false,
            owes_digest: false,
        }
    }

    /// There is news for it.
    pub(super) fn poke(&mut self, settings: &Settings, now: SimTime) {
        self.due = Some(now);
        self.delay = settings.resend_first;
    }

    /// It has said what it has. If it asks for an answer it has restarted, or was out of reach: what it
    /// lacks is sent at once. If it answers, what it lacks is sent when it is time, so that two who
    /// disagree do not answer each other without end.
    pub(super) fn told(&mut self, settings: &Settings, now: SimTime, asks: bool) {
        if asks {
            self.poke(settings, now);
        } else {
            self.has_met = true;
            self.due.get_or_insert(now);
        }
    }

    /// Something was sent: the next time is later, by twice the delay of this time.
    pub(super) fn sent(&mut self, settings: &Settings, now: SimTime) {
        self.due = Some(now.saturating_add(self.delay));
        self.delay = (self.delay * 2).min(settings.resend_most);
    }

    /// It was heard from. After a silence both sides have much to tell, so that what waits is sent at
    /// once, with a digest.
    pub(super) fn hear(&mut self, settings: &Settings, now: SimTime) {
        let before = self.heard.replace(now);
        let silence = before.map(|before| now.since(before));
        if silence.is_none_or(|silence| silence > settings.resend_most * 2) {
            self.owes_digest = true;
            self.poke(settings, now);
        }
    }

    /// It says how many outcomes of each rover it has.
    pub(super) fn has(&mut self, have: &[u32]) {
        for (known, said) in self.has.iter_mut().zip(have) {
            *known = (*known).max(*said);
        }
    }
}
