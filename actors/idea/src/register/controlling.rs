//! The controlling side: sets procedures, and hears what becomes of them.

use std::sync::Arc;

use farside::SimTime;

use super::{
    Acknowledged, Backoff, ContractEnd, ContractKey, RegisterAck, RegisterLoad, RegisterStatus,
    RegisterValue,
};

/// The controlling side of a register.
#[derive(Clone, Debug)]
pub struct Controlling {
    register: Arc<str>,
    epoch: u32,
    backoff: Backoff,
    /// How many procedures were loaded.
    number: u32,
    /// How many of the last ones were ended here before an answer came.
    superseded: u32,
    /// Whether the last one's end was heard of.
    is_over: bool,
    /// The revision of the last one's last status.
    revision: Option<u32>,
    /// The last one.
    present: Option<RegisterLoad>,
    /// How often it was sent.
    times: u32,
    /// Until it is acknowledged: when it is to be said again.
    again: Option<SimTime>,
    question: Option<Question>,
}

/// What a new life asks until it is answered.
#[derive(Clone, Copy, Debug)]
struct Question {
    contract: ContractKey,
    /// How often it was asked.
    times: u32,
    again: SimTime,
}

/// What a status is to the controlling side.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Heard {
    /// News of the present contract.
    News {
        /// Its outputs.
        outputs: Vec<Option<RegisterValue>>,
        /// Whether it is over, and how.
        end: ContractEnd,
    },
    /// Nothing new of the present contract.
    Again,
    /// The end of a contract of a former life, which was asked for.
    Answer {
        /// Its outputs.
        outputs: Vec<Option<RegisterValue>>,
        /// How it is over.
        end: ContractEnd,
    },
    /// Of a contract that is over here, or of another epoch.
    Stale,
}

impl Controlling {
    /// The controlling side of a register in its life `epoch`, from 1.
    pub fn new(register: Arc<str>, epoch: u32, backoff: Backoff) -> Self {
        Controlling {
            register,
            epoch,
            backoff,
            number: 0,
            superseded: 0,
            is_over: true,
            revision: None,
            present: None,
            times: 0,
            again: None,
            question: None,
        }
    }

    /// The register's name.
    pub fn register(&self) -> &Arc<str> {
        &self.register
    }

    /// Which of its agent's lives it is in, from 1.
    pub fn epoch(&self) -> u32 {
        self.epoch
    }

    /// The number of the present procedure; 0 before the first.
    pub fn number(&self) -> u32 {
        self.number
    }

    /// Sets the procedure: what is to be sent.
    pub fn load(
        &mut self,
        procedure: Arc<str>,
        inputs: Vec<RegisterValue>,
        now: SimTime,
    ) -> RegisterLoad {
        self.superseded = match self.is_over {
            true => 0,
            false => self.superseded.saturating_add(1),
        };
        self.number = self.number.saturating_add(1);
        self.is_over = false;
        self.revision = None;
        let load = RegisterLoad {
            register: self.register.clone(),
            epoch: self.epoch,
            number: self.number,
            superseded: self.superseded,
            procedure,
            inputs,
        };
        self.present = Some(load.clone());
        self.times = 1;
        self.again = Some(now + self.backoff.after(1));
        load
    }

    /// When something is to be said again.
    pub fn due(&self) -> Option<SimTime> {
        self.again
    }

    /// What is said again now, and how often it was said before; nothing if it is not time.
    pub fn repeat(&mut self, now: SimTime) -> Option<(RegisterLoad, u32)> {
        self.again.filter(|again| *again <= now)?;
        let said = self.say_again()?;
        self.again = Some(now + self.backoff.after(self.times));
        Some(said)
    }

    /// The present load, to be sent though it may have been acknowledged, so that the other side
    /// hears something, and answers; and how often it was said before.
    pub fn say_again(&mut self) -> Option<(RegisterLoad, u32)> {
        let load = self.present.clone()?;
        let before = self.times;
        self.times = before.saturating_add(1);
        Some((load, before))
    }

    /// The load was acknowledged.
    pub fn acknowledged(&mut self, ack: &RegisterAck) {
        if ack.of == Acknowledged::Load && self.is_mine(ack.epoch, ack.number) {
            self.heard_of_load();
        }
    }

    /// The controlled side has taken the load: those that were superseded will never begin.
    fn heard_of_load(&mut self) {
        self.again = None;
        self.superseded = 0;
    }

    fn is_mine(&self, epoch: u32, number: u32) -> bool {
        epoch == self.epoch && number == self.number
    }

    /// What a status is. News is to be acknowledged once it was acted upon, and so is what is heard
    /// again or is stale ([`Controlling::ack`]).
    pub fn status(&mut self, status: &RegisterStatus) -> Heard {
        let contract = (status.epoch, status.number);
        let is_asked = |question: &mut Question| {
            question.contract == contract && status.end != ContractEnd::Open
        };
        if self.question.take_if(is_asked).is_some() {
            return Heard::Answer {
                outputs: status.outputs.clone(),
                end: status.end.clone(),
            };
        }
        if !self.is_mine(status.epoch, status.number) {
            return Heard::Stale;
        }
        self.heard_of_load();
        if self.is_over || self.revision.is_some_and(|last| status.revision <= last) {
            return Heard::Again;
        }
        self.revision = Some(status.revision);
        self.is_over = status.end != ContractEnd::Open;
        Heard::News {
            outputs: status.outputs.clone(),
            end: status.end.clone(),
        }
    }

    /// Asks what has become of a contract that a former life has loaded, again and again until it is
    /// answered ([`Heard::Answer`]).
    pub fn ask(&mut self, contract: ContractKey) {
        self.question = Some(Question {
            contract,
            times: 0,
            again: SimTime::ZERO,
        });
    }

    /// What is asked now, and how often it was asked before; nothing if it is not time. Nothing is asked
    /// before the other side has taken a load of this life: it would not be answered.
    pub fn repeat_question(&mut self, now: SimTime) -> Option<(RegisterStatus, u32)> {
        let is_taken = self.number > 0 && self.again.is_none();
        let question = self.question.as_mut();
        let question = question.filter(|question| is_taken && question.again <= now)?;
        let before = question.times;
        question.times = before.saturating_add(1);
        question.again = now + self.backoff.after(question.times);
        let (epoch, number) = question.contract;
        let asked = RegisterStatus {
            register: self.register.clone(),
            epoch,
            number,
            revision: 0,
            outputs: Vec::new(),
            end: ContractEnd::Open,
        };
        Some((asked, before))
    }

    /// Whether the present contract is open: no status has ended it.
    pub fn is_open(&self) -> bool {
        !self.is_over
    }

    /// The acknowledgement of a status.
    pub fn ack(status: &RegisterStatus) -> RegisterAck {
        RegisterAck {
            register: status.register.clone(),
            epoch: status.epoch,
            number: status.number,
            of: Acknowledged::Status {
                revision: status.revision,
            },
        }
    }
}
