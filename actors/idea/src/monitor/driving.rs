//! For how long a rover drove though its system agent had not been heard of within the lease: judged
//! from messages alone, whatever relay and hardware say of themselves.

use farside::record::{Record, RecordClass};
use farside::{SimDuration, SimTime};
use farside_actors::rover::{Command, CommandReport, Part, RoverCommand};

/// A rover's wheels and its lease.
#[derive(Debug)]
pub(crate) struct Driving {
    lease: SimDuration,
    /// When the relay last heard of the system agent.
    heard: SimTime,
    /// The commands that turn the wheels, by their numbers.
    running: Vec<u32>,
    /// Up to when it is judged.
    judged: SimTime,
    without_lease: SimDuration,
}

impl Driving {
    /// A rover that stands still.
    pub(crate) fn new(lease: SimDuration) -> Self {
        Driving {
            lease,
            heard: SimTime::ZERO,
            running: Vec::new(),
            judged: SimTime::ZERO,
            without_lease: SimDuration::ZERO,
        }
    }

    /// For how long it drove without a lease, up to a time.
    pub(crate) fn without_lease(&mut self, until: SimTime) -> SimDuration {
        self.judge(until);
        self.without_lease
    }

    fn judge(&mut self, until: SimTime) {
        if !self.running.is_empty() && !self.lease.is_zero() {
            let from = self.judged.max(self.heard + self.lease);
            self.without_lease = self.without_lease + until.since(from);
        }
        self.judged = until;
    }

    /// Something happened to the relay or the hardware.
    pub(super) fn record(&mut self, record: &Record<'_>) {
        if record.class == RecordClass::Crash {
            // A crash of the computer that drives it: what ran ends with its step.
            self.judge(record.time());
            self.running.clear();
        }
        let Some(kind) = record
            .kind
            .filter(|_| record.class == RecordClass::Delivered)
        else {
            return;
        };
        match kind.name() {
            "RegisterLoad" | "RegisterStatus" | "RegisterAck" => {
                self.judge(record.time());
                self.heard = record.time();
            }
            "RoverCommand" => {
                let Ok(command) = kind.schema().decode::<RoverCommand>(record.body) else {
                    return;
                };
                let turns_wheels = matches!(
                    command.command,
                    Command::Drive { .. } | Command::Turn { .. } | Command::BackUp { .. }
                );
                if turns_wheels {
                    self.judge(record.time());
                    self.running.push(command.id);
                }
            }
            "CommandReport" => {
                let Ok(report) = kind.schema().decode::<CommandReport>(record.body) else {
                    return;
                };
                if report.part == Some(Part::Wheels) {
                    self.judge(record.time());
                    self.running.retain(|id| *id != report.id);
                }
            }
            _ => {}
        }
    }
}
