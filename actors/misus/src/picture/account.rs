//! What a rover did on its tour and what it waited for, from the commands that its scientist gave and how they ended.

use std::collections::BTreeMap;

use farside::encoding::{DecodeError, Schema, SchemaError};
use farside::record::RecordClass;
use farside_actors::rover::{
    Command, CommandEnd, CommandReport, Failure, FaultBegins, RoverCommand, StopCause, View,
    hardware_name,
};
use farside_actors::system::{Account, Doing, Phase, PictureError, Recorded, Recording};

use crate::messages::Stop;

/// The account of an actor up to a time; none if it is not of a rover. A scientist and its hardware have one
/// account.
pub(crate) fn account(
    rovers: &[String],
    actor: &str,
    run: &dyn Recording,
    until_ns: Option<u64>,
) -> Result<Option<Account>, PictureError> {
    let is_its = |name: &&String| *name == actor || hardware_name(name) == actor;
    let Some(rover) = rovers.iter().find(is_its) else {
        return Ok(None);
    };
    let tour = Tour::read(rover, run)?;
    let until_ns = until_ns.map_or(tour.end_ns, |until| until.min(tour.end_ns));
    Ok(Some(tour.account(until_ns)))
}

/// A command that was given: when, which, and to which rock the rover was on its way.
struct Given {
    time_ns: u64,
    command: Command,
    rock: Option<u32>,
    ended: Option<(u64, CommandEnd)>,
}

/// What is recorded of a rover, in order of time.
#[derive(Default)]
struct Tour {
    given: Vec<Given>,
    faults: Vec<(u64, String)>,
    /// From when to when its scientist was down.
    outages: Vec<(u64, Option<u64>)>,
    end_ns: u64,
}

/// The schemas of what is read.
struct Schemas {
    command: Schema,
    report: Schema,
    stop: Schema,
    fault: Schema,
}

impl Schemas {
    fn new() -> Result<Schemas, SchemaError> {
        Ok(Schemas {
            command: Schema::of::<RoverCommand>()?,
            report: Schema::of::<CommandReport>()?,
            stop: Schema::of::<Stop>()?,
            fault: Schema::of::<FaultBegins>()?,
        })
    }
}

/// What is remembered of a tour while it is read.
#[derive(Default)]
struct Reading {
    rock: Option<u32>,
    /// By its number, the last command that has not ended, as a place among those that were given.
    running: BTreeMap<u32, usize>,
}

impl Tour {
    fn read(rover: &str, run: &dyn Recording) -> Result<Tour, PictureError> {
        let schemas = Schemas::new().map_err(|error| {
            PictureError::NotDrawn(format!("what it was told cannot be read: {error}"))
        })?;
        let hardware = hardware_name(rover);
        let (mut tour, mut reading) = (Tour::default(), Reading::default());
        let ending = run.for_each(&mut |record| {
            tour.end_ns = tour.end_ns.max(record.time_ns);
            if record.actor != rover && record.actor != hardware {
                return Ok(());
            }
            let met = tour.meet(record, record.actor == rover, &mut reading, &schemas);
            met.map_err(|error| {
                let (actor, kind) = (record.actor, record.kind);
                PictureError::Unreadable(format!("a {kind} of {actor} cannot be read: {error}"))
            })
        })?;
        tour.end_ns = ending.time_ns.unwrap_or(tour.end_ns);
        Ok(tour)
    }

    fn meet(
        &mut self,
        record: &Recorded<'_>,
        is_scientist: bool,
        reading: &mut Reading,
        schemas: &Schemas,
    ) -> Result<(), DecodeError> {
        let time_ns = record.time_ns;
        match (record.class, record.kind) {
            (RecordClass::Sample, "Stop") => {
                let stop: Stop = schemas.stop.decode(record.body)?;
                reading.rock = Some(stop.rock);
            }
            (RecordClass::Delivered, "RoverCommand") => {
                let RoverCommand { id, command } = schemas.command.decode(record.body)?;
                reading.running.insert(id, self.given.len());
                self.given.push(Given {
                    time_ns,
                    command,
                    rock: reading.rock,
                    ended: None,
                });
            }
            (RecordClass::Delivered, "CommandReport") => {
                let report: CommandReport = schemas.report.decode(record.body)?;
                if let Some(at) = reading.running.remove(&report.id) {
                    self.given[at].ended = Some((time_ns, report.end));
                }
            }
            (RecordClass::Told, "FaultBegins") => {
                let fault: FaultBegins = schemas.fault.decode(record.body)?;
                self.faults
                    .push((time_ns, fault.kind.name().replace('-', " ")));
            }
            (RecordClass::Crash, _) if is_scientist => self.outages.push((time_ns, None)),
            (RecordClass::Restart, _) if is_scientist => {
                if let Some((_, end)) = self.outages.last_mut() {
                    end.get_or_insert(time_ns);
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn account(&self, until_ns: u64) -> Account {
        let mut account = Account::default();
        let mut at_ns = 0;
        let given: Vec<&Given> = self
            .given
            .iter()
            .filter(|given| given.time_ns < until_ns)
            .collect();
        for (at, one) in given.iter().enumerate() {
            let next_ns = given.get(at + 1).map_or(until_ns, |next| next.time_ns);
            let ended = one
                .ended
                .as_ref()
                .filter(|(ended_ns, _)| *ended_ns <= until_ns);
            let ended_ns = ended.map_or(next_ns, |(ended_ns, _)| *ended_ns).max(at_ns);
            account.push(pause(at_ns, one.time_ns));
            account.push(self.phase(
                one,
                (one.time_ns.max(at_ns), ended_ns),
                ended.map(|(_, end)| end),
            ));
            at_ns = ended_ns;
        }
        account.push(pause(at_ns, until_ns));
        account.with_outages(self.outages.iter().copied(), until_ns)
    }

    /// A command is carried out.
    fn phase(
        &self,
        given: &Given,
        (from_ns, until_ns): (u64, u64),
        end: Option<&CommandEnd>,
    ) -> Phase {
        let (doing, mut text) = said(&given.command, given.rock);
        text.push_str(&end.map_or(String::new(), ended));
        let faults = self.faults.iter();
        for (at_ns, fault) in faults.filter(|(at_ns, _)| (from_ns..until_ns).contains(at_ns)) {
            let at = farside::SimDuration::from_nanos(*at_ns);
            text.push_str(&format!("; {fault} at {at}"));
        }
        Phase {
            from_ns,
            until_ns,
            doing,
            text,
            waits_for: Vec::new(),
        }
    }
}

/// Nothing runs.
fn pause(from_ns: u64, until_ns: u64) -> Phase {
    Phase {
        from_ns,
        until_ns,
        doing: Doing::Waiting,
        text: "has no command running: asks how it is, or waits to go on".to_owned(),
        waits_for: Vec::new(),
    }
}

fn said(command: &Command, rock: Option<u32>) -> (Doing, String) {
    let rock = rock.map_or("a rock".to_owned(), |rock| format!("rock {rock}"));
    let seen = |view: &View| match view {
        View::Point => format!("of {rock}"),
        View::Panorama => "of all around".to_owned(),
    };
    let text = match command {
        Command::Drive { .. } => format!("drives to {rock}"),
        Command::Turn { .. } => "turns".to_owned(),
        Command::BackUp { distance_m } => {
            format!("backs up by {distance_m} m, on its way to {rock}")
        }
        Command::Stop { .. } => "stops".to_owned(),
        Command::PanTilt { .. } => format!("points its mast at {rock}"),
        Command::Image { view, .. } => format!("takes an image {}", seen(view)),
        Command::Spectrum { view, .. } => format!("takes a spectrum {}", seen(view)),
        Command::Transmit { to, size_bytes } => format!("sends {size_bytes} bytes to {to}"),
        Command::Heat { .. } => "heats".to_owned(),
        Command::Fans { on: true } => "turns its fans on".to_owned(),
        Command::Fans { on: false } => "turns its fans off".to_owned(),
        Command::Sleep { .. } => {
            return (Doing::Waiting, "sleeps, for light or for charge".to_owned());
        }
    };
    (Doing::Active, text)
}

/// How it ended, unless as it was meant to.
fn ended(end: &CommandEnd) -> String {
    let failed = |why: &str| format!(": failed, {why}");
    match end {
        CommandEnd::Done => String::new(),
        CommandEnd::Stopped {
            by: StopCause::Command,
        } => ": stopped".to_owned(),
        CommandEnd::Stopped {
            by: StopCause::Lease,
        } => ": stopped, its scientist was not heard of".to_owned(),
        CommandEnd::Failed { reason } => match reason {
            Failure::Blocked { .. } => failed("the way is blocked"),
            Failure::BrownOut => failed("the battery is empty"),
            Failure::InstrumentFailed => failed("the instrument failed"),
            Failure::MastStuck => failed("the mast is stuck"),
            Failure::MemoryFull => failed("the memory is full"),
        },
        CommandEnd::Refused { .. } => ": refused".to_owned(),
    }
}
