//! The controlled side: takes procedures, each at most once and in order, and says what becomes of
//! them. All of it is durable.

use std::cmp::Ordering;
use std::sync::Arc;

use farside::SimTime;

use super::{
    Acknowledged, Backoff, ContractEnd, RegisterAck, RegisterLoad, RegisterStatus, RegisterValue,
};

/// The controlled side of a register: what outlives a crash.
#[derive(Clone, Debug)]
pub struct Controlled {
    register: Arc<str>,
    backoff: Backoff,
    /// The epoch and the number of the last procedure that was taken; 0 before the first.
    epoch: u32,
    number: u32,
    /// Whether it goes on.
    is_open: bool,
    /// What was last said of it.
    said: Option<RegisterStatus>,
    /// Until it is acknowledged: how often it was said, and when it is to be said again.
    unheard: Option<(u32, SimTime)>,
    /// How the last contract of each former life of the controlling side ended, of those lives that
    /// loaded any: a later life may ask.
    former: Vec<RegisterStatus>,
}

/// What a load is to the controlled side.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Taken {
    /// The register says this procedure from now on.
    Yes,
    /// It was taken before: this is to be said once more, if there is something to say.
    Before(Option<RegisterStatus>),
    /// It is of an epoch that is over, or older than the last one.
    Old,
    /// One before it is missing that may not be skipped.
    Early,
}

impl Controlled {
    /// The controlled side of a register that was never loaded.
    pub fn new(register: Arc<str>, backoff: Backoff) -> Self {
        Controlled {
            register,
            backoff,
            epoch: 0,
            number: 0,
            is_open: false,
            said: None,
            unheard: None,
            former: Vec::new(),
        }
    }

    /// The register's name.
    pub fn register(&self) -> &Arc<str> {
        &self.register
    }

    /// Epoch and number of the present contract.
    pub fn contract(&self) -> (u32, u32) {
        (self.epoch, self.number)
    }

    /// Whether the present contract goes on.
    pub fn is_open(&self) -> bool {
        self.is_open
    }

    /// Takes a load, if it is the next one. What went on before it is over: its status is not said any
    /// more, but if the load is the first of a new life of the controlling side, that life may
    /// [ask](Controlled::asked) for it.
    pub fn take(&mut self, load: &RegisterLoad, now: SimTime) -> Taken {
        if load.epoch < self.epoch || load.number == 0 {
            return Taken::Old;
        }
        let last = match load.epoch == self.epoch {
            true => self.number,
            // A new life begins to count anew.
            false => 0,
        };
        if load.number <= last {
            return match load.number == last {
                true => Taken::Before(self.said.clone()),
                false => Taken::Old,
            };
        }
        if load.number - last - 1 > load.superseded {
            return Taken::Early;
        }
        if load.epoch > self.epoch && self.number > 0 {
            if self.is_open {
                self.say(Vec::new(), ContractEnd::Fault, now);
            }
            self.former.extend(self.said.take());
        }
        self.epoch = load.epoch;
        self.number = load.number;
        self.is_open = true;
        self.said = None;
        self.unheard = None;
        Taken::Yes
    }

    /// The acknowledgement of the present load.
    pub fn ack(&self) -> RegisterAck {
        RegisterAck {
            register: self.register.clone(),
            epoch: self.epoch,
            number: self.number,
            of: Acknowledged::Load,
        }
    }

    /// Says what has become of the present contract; nothing, if it is over already.
    pub fn say(
        &mut self,
        outputs: Vec<Option<RegisterValue>>,
        end: ContractEnd,
        now: SimTime,
    ) -> Option<RegisterStatus> {
        if !self.is_open {
            return None;
        }
        self.is_open = end == ContractEnd::Open;
        let before = self.said.as_ref();
        let status = RegisterStatus {
            register: self.register.clone(),
            epoch: self.epoch,
            number: self.number,
            revision: before.map_or(0, |before| before.revision.saturating_add(1)),
            outputs,
            end,
        };
        self.said = Some(status.clone());
        self.unheard = Some((1, now + self.backoff.after(1)));
        Some(status)
    }

    /// After a restart: what was going on is not any more. What is to be said of it, or once more of
    /// what had ended; nothing if all is acknowledged.
    pub fn restarted(&mut self, now: SimTime) -> Option<RegisterStatus> {
        if self.is_open {
            return self.say(Vec::new(), ContractEnd::Fault, now);
        }
        self.unheard?;
        self.unheard = Some((1, now + self.backoff.after(1)));
        self.said.clone()
    }

    /// When something is to be said again.
    pub fn due(&self) -> Option<SimTime> {
        self.unheard.map(|(_, again)| again)
    }

    /// What is said again now, and how often it was said before; nothing if it is not time.
    pub fn repeat(&mut self, now: SimTime) -> Option<(RegisterStatus, u32)> {
        let (times, _) = self.unheard.filter(|(_, again)| *again <= now)?;
        let status = self.said.clone()?;
        let next = times.saturating_add(1);
        self.unheard = Some((next, now + self.backoff.after(next)));
        Some((status, times))
    }

    /// A status was acknowledged.
    pub fn acknowledged(&mut self, ack: &RegisterAck) {
        let Acknowledged::Status { revision } = ack.of else {
            return;
        };
        let is_heard = |said: &RegisterStatus| {
            (said.epoch, said.number) == (ack.epoch, ack.number) && said.revision <= revision
        };
        if self.said.as_ref().is_some_and(is_heard) {
            self.unheard = None;
        }
    }

    /// A later life of the controlling side asks what has become of a contract. Nothing is said as long
    /// as that contract may still begin or end: the life that loaded it is over only when a later one has
    /// loaded something.
    pub fn asked(&self, question: &RegisterStatus) -> Option<RegisterStatus> {
        if question.epoch >= self.epoch {
            return None;
        }
        let last = self.former.iter().find(|one| one.epoch == question.epoch);
        let end = match last.map(|last| (last, last.number.cmp(&question.number))) {
            Some((last, Ordering::Equal)) => return Some(last.clone()),
            // That life itself has set another procedure in its place.
            Some((_, Ordering::Greater)) => ContractEnd::Fault,
            Some((_, Ordering::Less)) | None => ContractEnd::Refused {
                reason: "it never came".to_owned(),
            },
        };
        Some(RegisterStatus {
            register: self.register.clone(),
            epoch: question.epoch,
            number: question.number,
            revision: 0,
            outputs: Vec::new(),
            end,
        })
    }
}
