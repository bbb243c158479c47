//! Replaying actors of a run from its log: [`farside::replay`] fed with records, in their order.

mod again;
mod told;

use std::collections::BTreeMap;
use std::sync::Arc;

use farside::key::EventKey;
use farside::record::RecordClass;
use farside::replay::{Charge, ChargedMessage, OutputClass, RecordEnd, Recorded, Replay};
use farside::{EntityId, MatchKey, RunInfo, SimTime};
use hashbrown::HashMap;
use rustc_hash::FxBuildHasher;

pub use again::{Again, again};
pub use told::{OutputCount, OutputSide, ReplayOutcome, ReplayedOutput, ReplayedStep};

use crate::LogError;
use crate::channel::{ChannelInfo, Role, SchemaInfo};
use crate::envelope::{KeyRef, RecordRef};
use crate::log::{Log, Records, Step};
use crate::scan::{Position, ScannedMessage};
use crate::topics::{Topics, topic_before_1_3, topic_of};
use told::Schemas;

/// Replays actors from a log, from its first record to its last.
///
/// ```no_run
/// use farside::Simulation;
/// use farside::replay::Replay;
/// # fn assemble() -> Simulation { Simulation::new(7) }
///
/// let sim = assemble(); // built as it was for the log, perhaps with a new planner
/// let replay = Replay::new(sim, |name| name == "planner")?;
/// let log = farside_logs::Log::open("run.mcap")?;
/// let outcome = farside_logs::replay(&log, replay, &[])?;
/// if let Some(first) = outcome.first {
///     println!("{} s: {} of {}", first.time_s, first.kind, first.actor);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// `charges` are what links charged, where the actors ask for it ([`charges_in`]).
///
/// # Errors
/// If the log cannot be read, or holds what the replay's actors cannot take; not if it is cut.
pub fn replay(
    log: &Log,
    mut replay: Replay,
    charges: &[Charge],
) -> Result<ReplayOutcome, LogError> {
    leave_out(log, &mut replay)?;
    if !charges.is_empty() {
        replay.charges_are_told();
    }
    for charge in charges {
        replay.charge(charge);
    }
    let info = replay.info().clone();
    let names = Arc::new(Names::of(&replay));
    let live = accepted(&replay);
    let wrong = |reason: String| LogError::Replay {
        path: log.path().to_owned(),
        reason,
    };
    let mut records = log.records_but(names.far_samples())?;
    let concerning = names.clone();
    records.pass_over(move |envelope| !concerning.concern(envelope));
    let mut schemas: BTreeMap<String, Arc<SchemaInfo>> = BTreeMap::new();
    let mut last = Last::default();
    loop {
        match records.step()? {
            Step::End => break,
            Step::Checkpoint => {}
            Step::Sample => {
                let (record, channel) = records.sample()?;
                if let Some(schema) = &channel.schema
                    && !schemas.contains_key(record.kind)
                {
                    schemas.insert(record.kind.to_owned(), schema.clone());
                }
                if let Some(actor) = names.entity(record.sender) {
                    let fed = replay.feed(&sampled(&record, actor));
                    fed.map_err(|error| wrong(error.to_string()))?;
                }
            }
            Step::Record => {
                let message = records.message()?;
                last.meet(&message);
                // Messages outside chunks, and what was in flight, are not passed over.
                if !names.concern(message.data) {
                    continue;
                }
                let (record, _) = records.record()?;
                let read = names.recorded(&record).map_err(&wrong)?;
                let fed = replay.feed(&read);
                fed.map_err(|error| wrong(error.to_string()))?;
            }
        }
    }
    last.pass(records.passed());
    let end = last.end_of(&mut records, log.head().epoch_ns, &names)?;
    let report = replay.finish(end);
    let ending = records.ending();
    let mut outcome = ReplayOutcome::of(
        &report,
        &Schemas {
            info: &info,
            samples: &schemas,
        },
    );
    outcome.missing_record = ending.missing();
    if hides_steps(log, &info, &live)? {
        outcome.differing_instants = 0;
        outcome.first_differing_instant_s = None;
    }
    Ok(outcome)
}

/// Where the last record is, but for messages in flight.
#[derive(Default)]
struct Last {
    log_time: u64,
    place: Option<(Position, u32)>,
}

impl Last {
    fn meet(&mut self, message: &ScannedMessage<'_>) {
        self.log_time = message.head.log_time;
        if !message.channel.topic.starts_with("/in_flight/") {
            self.place = Some((message.position, message.channel.serial));
        }
    }

    /// Of what was passed over the last record.
    fn pass(&mut self, passed: Option<(u64, Position, u32)>) {
        let Some((log_time, position, serial)) = passed else {
            return;
        };
        self.log_time = self.log_time.max(log_time);
        if self.place.is_none_or(|(known, _)| known < position) {
            self.place = Some((position, serial));
        }
    }

    /// How the record ends, as the replay wants to know it.
    fn end_of(
        &self,
        records: &mut Records,
        epoch_ns: u64,
        names: &Names,
    ) -> Result<RecordEnd, LogError> {
        let ending = records.ending();
        let logged = SimTime::from_nanos(self.log_time.saturating_sub(epoch_ns));
        let at = ending.text("end_time_ns").and_then(|at| at.parse().ok());
        let at = at.map_or(logged, SimTime::from_nanos);
        let text = match ending.text("end").filter(|_| ending.cut.is_none()) {
            Some("completed") => return Ok(RecordEnd::Completed { at }),
            Some("stopped") => return Ok(RecordEnd::Stopped { at }),
            Some("fault") => Some(ending.text("end_detail").unwrap_or_default().to_owned()),
            _ => None,
        };
        let last = match self.place {
            Some((position, serial)) => {
                let message = records.message_at(position, serial)?;
                let last = RecordRef::read(message.data);
                let last = last.and_then(|last| names.recorded(&last).ok());
                last.map(|last| last.key)
            }
            None => None,
        };
        Ok(match text {
            Some(text) => RecordEnd::Fault { at, text, last },
            None => RecordEnd::Cut { at: logged, last },
        })
    }
}

/// The entities of the simulation by name, and whose records matter: most are passed over by their first bytes.
struct Names {
    info: Arc<RunInfo>,
    numbers: HashMap<Box<str>, EntityId, FxBuildHasher>,
    /// By entity.
    is_near: Vec<bool>,
    /// By length, which last bytes the names of the near ones have: few others share both.
    ends: Vec<[u64; 4]>,
}

impl Names {
    fn of(replay: &Replay) -> Self {
        let info = replay.info().clone();
        let entities = || (0..info.entities.len()).map(EntityId::from_index);
        let is_near: Vec<bool> = entities().map(|entity| replay.is_near(entity)).collect();
        let mut ends = vec![[0; 4]; 0x80];
        for entity in entities().filter(|entity| is_near[entity.index()]) {
            let name = info.name(entity).as_bytes();
            if let (Some(of_length), Some(&end)) = (ends.get_mut(name.len()), name.last()) {
                of_length[usize::from(end >> 6)] |= 1 << (end & 63);
            }
        }
        let numbers = entities().map(|entity| (Box::from(info.name(entity)), entity));
        Names {
            numbers: numbers.collect(),
            is_near,
            ends,
            info,
        }
    }

    fn entity(&self, name: &str) -> Option<EntityId> {
        self.numbers.get(name).copied()
    }

    fn is_near(&self, name: &[u8]) -> bool {
        if let (Some(of_length), Some(&end)) = (self.ends.get(name.len()), name.last())
            && of_length[usize::from(end >> 6)] >> (end & 63) & 1 == 0
        {
            return false;
        }
        let entity = std::str::from_utf8(name).ok();
        let entity = entity.and_then(|name| self.entity(name));
        entity.is_some_and(|entity| self.is_near[entity.index()])
    }

    /// Whether an envelope may be of something that concerns the living.
    fn concern(&self, envelope: &[u8]) -> bool {
        // Writers put these two in front; of others every record is looked at.
        let Some((sender, rest)) = short_text(envelope, 1) else {
            return true;
        };
        let Some((receiver, _)) = short_text(rest, 2) else {
            return true;
        };
        self.is_near(receiver) || self.is_near(sender) || receiver == b"@control"
    }

    /// Tells the channels of state samples of actors that are not near.
    fn far_samples(&self) -> impl Fn(&ChannelInfo) -> bool + Send + 'static {
        let near = self.is_near.iter().zip(&self.info.entities);
        let near = near.filter(|(is_near, _)| **is_near);
        let near: Vec<String> = near.map(|(_, entity)| entity.name.clone()).collect();
        move |channel| {
            channel.role == Role::Sample && near.iter().all(|near| near != channel.sampled())
        }
    }

    /// A record with names for numbers.
    fn recorded<'a>(&self, record: &RecordRef<'a>) -> Result<Recorded<'a>, String> {
        let entity = |name: &str| {
            let found = self.entity(name);
            found.ok_or_else(|| {
                let names = self.info.entities.iter().map(|entity| entity.name.as_str());
                let close = farside::suggest::nearest(name, names);
                let hint = farside::suggest::did_you_mean(close.as_deref());
                format!("it names {name:?}, which the simulation does not have{hint}")
            })
        };
        let key = |key: &KeyRef<'_>| {
            Ok::<_, String>(EventKey {
                time: SimTime::from_nanos(key.time_ns),
                step: key.step,
                tie: key.tie,
                source: entity(key.source)?,
                count: key.count,
            })
        };
        Ok(Recorded {
            class: record.class,
            key: key(&record.key)?,
            cause: record.cause.as_ref().map(key).transpose()?,
            sender: entity(record.sender)?,
            receiver: entity(record.receiver)?,
            link: match record.link {
                "" => None,
                link => Some(entity(link)?),
            },
            kind: record.kind,
            ordinal: record.ordinal,
            copy: record.copy,
            match_key: record.match_key.map(MatchKey::from_bits),
            sent: SimTime::from_nanos(record.sent_ns),
            reason: record.reason,
            body: match record.class {
                RecordClass::Stop => record.note.as_bytes(),
                _ => record.body,
            },
            carriage: record.carriage,
        })
    }
}

/// The text of a field below 128 bytes, if that field is the first, and what comes after it.
fn short_text(envelope: &[u8], field: u8) -> Option<(&[u8], &[u8])> {
    const TEXT: u8 = 2;
    let (&[tag, len], rest) = envelope.split_first_chunk()?;
    let is_it = tag == field << 3 | TEXT && len < 0x80;
    rest.split_at_checked(len.into()).filter(|_| is_it)
}

/// A state sample of an actor.
fn sampled<'a>(record: &RecordRef<'a>, actor: EntityId) -> Recorded<'a> {
    let time = SimTime::from_nanos(record.key.time_ns);
    Recorded {
        class: RecordClass::Sample,
        key: EventKey {
            time,
            step: 0,
            tie: 0,
            source: actor,
            count: 0,
        },
        cause: None,
        sender: actor,
        receiver: actor,
        link: None,
        kind: record.kind,
        ordinal: record.ordinal,
        copy: 0,
        match_key: None,
        sent: time,
        reason: "",
        body: record.body,
        carriage: None,
    }
}

/// The topics of a log that were not written.
struct Filter {
    topics: Topics,
    is_before_1_3: bool,
}

impl Filter {
    fn of(log: &Log, globs: &[String]) -> Result<Self, LogError> {
        let minor = log.head().format.split_once('.');
        let minor = minor.and_then(|(_, minor)| minor.parse::<u32>().ok());
        Ok(Filter {
            topics: Topics::new(globs)?,
            is_before_1_3: minor.is_some_and(|minor| minor < 3),
        })
    }

    fn hides(&self, class: RecordClass, sender: &str, receiver: &str, kind: &str) -> bool {
        let topic = match self.is_before_1_3 {
            true => topic_before_1_3(class, sender, receiver, kind),
            false => topic_of(class, sender, receiver, kind),
        };
        self.topics.matches(&topic)
    }
}

/// The living actors, and the kinds that each accepts.
fn accepted(replay: &Replay) -> Vec<(EntityId, Vec<String>)> {
    let entities = (0..replay.info().entities.len()).map(EntityId::from_index);
    let live = entities.filter(|entity| replay.is_live(*entity));
    let accepts = |actor| replay.accepts(actor).into_iter().map(str::to_owned);
    live.map(|actor| (actor, accepts(actor).collect()))
        .collect()
}

/// True if events of the living actors are not in the log, so that they cannot be counted.
fn hides_steps(
    log: &Log,
    info: &RunInfo,
    live: &[(EntityId, Vec<String>)],
) -> Result<bool, LogError> {
    let filter = Filter::of(log, log.exclude())?;
    let classes = [RecordClass::Timer, RecordClass::Delivered];
    let hides = |(actor, kinds): &(EntityId, Vec<String>)| {
        let actor = info.name(*actor);
        let start = filter.hides(RecordClass::Start, actor, actor, "");
        let of_kind = |kind: &String| {
            let mut classes = classes.into_iter();
            classes.any(|class| filter.hides(class, actor, actor, kind))
        };
        start || kinds.iter().any(of_kind)
    };
    Ok(!log.exclude().is_empty() && live.iter().any(hides))
}

/// Leaves out of the comparison what the log does not hold.
fn leave_out(log: &Log, replay: &mut Replay) -> Result<(), LogError> {
    if log.exclude().is_empty() {
        return Ok(());
    }
    let filter = Filter::of(log, log.exclude())?;
    replay.leave_out(move |class, actor, kind| {
        let classes: &[RecordClass] = match class {
            OutputClass::Message => &[
                RecordClass::Delivered,
                RecordClass::Lost,
                RecordClass::InFlight,
            ],
            OutputClass::Change => &[RecordClass::Change],
            OutputClass::Sample => &[RecordClass::Sample],
            OutputClass::Stop => &[RecordClass::Stop],
            OutputClass::Fault => &[],
        };
        let mut classes = classes.iter();
        classes.any(|class| filter.hides(*class, actor, actor, kind))
    });
    Ok(())
}

/// The globs by which inputs of the replay's actors were left out of the log: what others may send them, what
/// they are told, their crashes and restarts. With any, the log alone does not do, and the run has to be
/// executed again ([`again`]).
///
/// # Errors
/// If a glob cannot be read.
pub fn filtered_inputs(log: &Log, replay: &Replay) -> Result<Vec<String>, LogError> {
    let mut found = Vec::new();
    let info = replay.info();
    let entities = || (0..info.entities.len()).map(EntityId::from_index);
    let mut kinds: Vec<&str> = entities()
        .filter(|entity| replay.is_live(*entity))
        .flat_map(|entity| replay.accepts(entity))
        .collect();
    kinds.sort_unstable();
    kinds.dedup();
    for glob in log.exclude() {
        let filter = Filter::of(log, std::slice::from_ref(glob))?;
        let sends = |entity: &EntityId| {
            let role = info.entities[entity.index()].role;
            role == farside::EntityRole::Actor && !replay.is_live(*entity)
        };
        let sent = || {
            entities().filter(sends).any(|sender| {
                let sender = info.name(sender);
                let hidden = |kind: &&str| filter.hides(RecordClass::Delivered, sender, "", kind);
                kinds.iter().any(hidden)
            })
        };
        let crossing = || {
            // Between living actors of two hosts links decide, and the log has what they decided.
            let live = entities().filter(|entity| replay.is_live(*entity));
            let hosts: Vec<_> = live
                .map(|entity| &info.entities[entity.index()].host)
                .collect();
            hosts.windows(2).any(|pair| pair[0] != pair[1])
                && entities()
                    .filter(|entity| replay.is_live(*entity))
                    .any(|sender| {
                        let sender = info.name(sender);
                        let hidden =
                            |kind: &&str| filter.hides(RecordClass::Delivered, sender, "", kind);
                        kinds.iter().any(hidden)
                    })
        };
        let happens = || {
            entities()
                .filter(|entity| replay.is_live(*entity))
                .any(|actor| {
                    let actor = info.name(actor);
                    let events = [RecordClass::Crash, RecordClass::Restart];
                    let told =
                        |kind: &&str| filter.hides(RecordClass::Told, "@control", actor, kind);
                    let mut events = events.into_iter();
                    events.any(|class| filter.hides(class, "@control", actor, ""))
                        || kinds.iter().any(told)
                })
        };
        if sent() || crossing() || happens() {
            found.push(glob.clone());
        }
    }
    Ok(found)
}

/// What links charged the hosts of the replay's actors for what was sent there, from how the log says that it
/// was carried: that a link charges as it says it does. None where that does not say when: a link that holds messages, or is shared, charges for each
/// attempt, and what was filtered is not known; then the run has to be executed again ([`again`]).
///
/// # Errors
/// If the log cannot be read.
pub fn charges_in(log: &Log, replay: &Replay) -> Result<Option<Vec<Charge>>, LogError> {
    if !log.exclude().is_empty() {
        return Ok(None);
    }
    let (info, names) = (replay.info(), Names::of(replay));
    let mut records = log.records_but(|channel| channel.role == Role::Sample)?;
    let mut charges = Vec::new();
    loop {
        match records.step()? {
            Step::End => break,
            Step::Record => {}
            Step::Checkpoint | Step::Sample => continue,
        }
        if !names.concern(records.message()?.data) {
            continue;
        }
        let (record, _) = records.record()?;
        // How a message is carried that is still on its way is not in the log.
        let is_under_way = record.class == RecordClass::InFlight
            && !record.link.is_empty()
            && names.is_near(record.sender.as_bytes());
        let is_silent = record.class.is_fate()
            && record.carriage.is_none()
            && !record.link.is_empty()
            && names.is_near(record.sender.as_bytes());
        if record.class == RecordClass::HandOver || is_under_way || is_silent {
            return Ok(None);
        }
        let energy_j = record.carriage.map_or(0.0, |carriage| carriage.energy_j);
        if !record.class.is_fate() || energy_j == 0.0 {
            continue;
        }
        let read = names.recorded(&record).map_err(|reason| LogError::Replay {
            path: log.path().to_owned(),
            reason,
        })?;
        let kind = info.kinds.iter().position(|kind| kind.name() == read.kind);
        let (Some(key), Some(kind)) = (read.cause, kind) else {
            continue;
        };
        charges.push(Charge {
            key,
            actor: read.sender,
            transmit_j: energy_j,
            receive_j: 0.0,
            message: Some(ChargedMessage {
                receiver: read.receiver,
                kind: kind as u32,
                ordinal: read.ordinal,
            }),
        });
    }
    charges.sort_by_key(|charge| charge.key);
    Ok(Some(charges))
}
