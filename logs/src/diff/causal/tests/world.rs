//! A small world whose runs are logged: actors that send what they know at planned times, over links that take
//! longer or shorter for each message, and one thing that may be otherwise.

use std::collections::BTreeMap;
use std::path::Path;

use mcap::records::MessageHeader;
use xxhash_rust::xxh3::xxh3_64;

use crate::envelope::field;
use crate::wire::{put_bytes, put_number, put_text};

/// When every run ends.
pub(super) const END_NS: u64 = 1_000_000_000;

/// A message that an actor sends at a planned time.
#[derive(Clone, Debug)]
pub(super) struct Send {
    pub(super) at_ns: u64,
    pub(super) from: usize,
    pub(super) to: usize,
}

/// What is otherwise in the other run.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Change {
    Nothing,
    /// A message is lost: of the flow, the one of this place.
    Lose(usize, usize, u64),
    /// A message comes later by so much.
    Delay(usize, usize, u64, u64),
    /// An actor crashes.
    Crash(usize, u64),
    /// An actor knows something else from the start.
    Key(usize),
    /// A link loses every other message from then on.
    Link(usize, usize, u64),
}

/// A message as it was sent, and what became of it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Message {
    pub(super) from: usize,
    pub(super) to: usize,
    pub(super) ordinal: u64,
    pub(super) sent_ns: u64,
    pub(super) body: u64,
    /// When it arrived, or was lost.
    pub(super) at_ns: u64,
    pub(super) lost: Option<&'static str>,
    /// The number of the tick in which it was sent.
    pub(super) tick: u64,
}

impl Message {
    /// What was said to whom, wherever in its flow.
    pub(super) fn said(&self) -> (usize, usize, u64, u64) {
        (self.from, self.to, self.sent_ns, self.body)
    }

    pub(super) fn id(&self) -> String {
        let (from, to) = (name(self.from), name(self.to));
        format!("{from},{to},Fact,{}", self.ordinal)
    }
}

/// A run of the world.
pub(super) struct Run {
    pub(super) messages: Vec<Message>,
    /// Ticks: who, when, the how manieth of it.
    ticks: Vec<(usize, u64, u64)>,
    change: Change,
}

pub(super) fn name(actor: usize) -> String {
    format!("rover_{actor}")
}

pub(super) fn link(from: usize, to: usize) -> String {
    format!("{}-{}", name(from), name(to))
}

fn hash(numbers: &[u64]) -> u64 {
    let bytes: Vec<u8> = numbers.iter().flat_map(|n| n.to_le_bytes()).collect();
    xxh3_64(&bytes)
}

/// Runs the world.
pub(super) fn run(actors: usize, plan: &[Send], change: &Change) -> Run {
    let mut known: Vec<u64> = (0..actors as u64).map(|actor| hash(&[actor])).collect();
    if let Change::Key(actor) = change {
        known[*actor] = hash(&[77]);
    }
    let mut plan = plan.to_vec();
    plan.sort_by_key(|send| (send.at_ns, send.from, send.to));
    let is_down = |actor: usize, at_ns: u64| matches!(change, Change::Crash(who, when) if *who == actor && *when <= at_ns);
    let mut run = Run {
        messages: Vec::new(),
        ticks: Vec::new(),
        change: change.clone(),
    };
    let mut ordinals: BTreeMap<(usize, usize), u64> = BTreeMap::new();
    let mut tick_counts = vec![0; actors];
    // Arrivals that are still to come, by time: the place of the message.
    let mut coming: BTreeMap<(u64, usize), usize> = BTreeMap::new();
    for send in plan {
        while let Some(entry) = coming
            .first_entry()
            .filter(|first| first.key().0 <= send.at_ns)
        {
            let at = entry.remove();
            arrive(&mut run.messages[at], &mut known, &is_down);
        }
        let (from, now) = (send.from, send.at_ns);
        let tick = tick_counts[from];
        tick_counts[from] += 1;
        if is_down(from, now) {
            continue;
        }
        run.ticks.push((from, now, tick));
        // Who knows certain things tells one more.
        let mut receivers = vec![send.to];
        if known[from].is_multiple_of(3) {
            receivers.push((send.to + 1) % actors);
        }
        for to in receivers.into_iter().filter(|to| *to != from) {
            let ordinal = ordinals.entry((from, to)).or_default();
            let drawn = hash(&[from as u64, to as u64, *ordinal]);
            let mut message = Message {
                from,
                to,
                ordinal: *ordinal,
                sent_ns: now,
                body: known[from],
                at_ns: now + 1_000_000 + drawn % 9_000_000,
                lost: None,
                tick,
            };
            *ordinal += 1;
            rule(&mut message, change, drawn);
            if message.lost.is_none() {
                coming.insert((message.at_ns, run.messages.len()), run.messages.len());
            }
            run.messages.push(message);
        }
    }
    while let Some((_, at)) = coming.pop_first() {
        arrive(&mut run.messages[at], &mut known, &is_down);
    }
    run
}

/// What the change makes of a message.
fn rule(message: &mut Message, change: &Change, drawn: u64) {
    let place = (message.from, message.to, message.ordinal);
    match change {
        Change::Lose(from, to, ordinal) if (*from, *to, *ordinal) == place => {
            message.lost = Some("ruled");
        }
        Change::Delay(from, to, ordinal, by_ns) if (*from, *to, *ordinal) == place => {
            message.at_ns += by_ns;
        }
        Change::Link(from, to, at_ns)
            if (*from, *to) == (message.from, message.to)
                && *at_ns <= message.sent_ns
                && (drawn >> 32).is_multiple_of(2) =>
        {
            message.lost = Some("loss");
            message.at_ns = message.sent_ns;
        }
        _ => {}
    }
}

fn arrive(message: &mut Message, known: &mut [u64], is_down: &impl Fn(usize, u64) -> bool) {
    if is_down(message.to, message.at_ns) {
        message.lost = Some("crashed");
        return;
    }
    let knows = &mut known[message.to];
    *knows = hash(&[*knows, message.body, message.at_ns]);
}

impl Run {
    /// The scenario, of which one key says what is otherwise.
    fn scenario(&self) -> String {
        let change = match &self.change {
            Change::Nothing => String::new(),
            Change::Lose(from, to, ordinal) => {
                let id = format!("{},{},Fact,{ordinal}", name(*from), name(*to));
                format!("[[lose]]\nmessage = \"{id}\"\n")
            }
            Change::Delay(from, to, ordinal, by_ns) => {
                let id = format!("{},{},Fact,{ordinal}", name(*from), name(*to));
                format!("[[postpone]]\nby = \"{by_ns}ns\"\nmessage = \"{id}\"\n")
            }
            Change::Crash(actor, at_ns) => {
                format!(
                    "[[crash]]\nactor = \"{}\"\nat = \"{at_ns}ns\"\n",
                    name(*actor)
                )
            }
            Change::Key(actor) => format!("[knows]\n{} = 77\n", name(*actor)),
            Change::Link(from, to, at_ns) => {
                let link = link(*from, *to);
                format!("[[degrade]]\nat = \"{at_ns}ns\"\nlinks = \"{link}\"\nloss = 0.5\n")
            }
        };
        format!("system = \"small\"\n{change}")
    }

    /// Its records: time, topic, role, envelope.
    fn records(&self) -> Vec<(u64, String, &'static str, Vec<u8>)> {
        let mut records = Vec::new();
        let planned = match &self.change {
            Change::Crash(actor, at_ns) => Some(("crash", name(*actor), *at_ns)),
            Change::Link(from, to, at_ns) => Some(("change", link(*from, *to), *at_ns)),
            _ => None,
        };
        // In the order in which keys at one time are: what was planned comes first.
        if let Some((class, whom, at_ns)) = planned {
            let mut out = Vec::new();
            put_text(&mut out, field::SENDER, &whom);
            put_text(&mut out, field::RECEIVER, &whom);
            put_text(&mut out, field::FATE, class);
            put_number(&mut out, field::TIME_NS, at_ns);
            put_text(&mut out, field::SOURCE, "@control");
            put_number(&mut out, field::SENT_NS, at_ns);
            records.push((at_ns, format!("/event/{class}"), "event", out));
        }
        for (actor, at_ns, tick) in &self.ticks {
            let actor = name(*actor);
            let mut out = Vec::new();
            put_text(&mut out, field::SENDER, &actor);
            put_text(&mut out, field::RECEIVER, &actor);
            put_text(&mut out, field::KIND, "Tick");
            put_text(&mut out, field::FATE, "timer");
            put_number(&mut out, field::ORDINAL, *tick);
            put_number(&mut out, field::TIME_NS, *at_ns);
            put_text(&mut out, field::SOURCE, &actor);
            put_number(&mut out, field::COUNT, *tick);
            records.push((*at_ns, format!("/timer/{actor}/tick"), "event", out));
        }
        for message in &self.messages {
            records.push(record(message));
        }
        records.sort_by_key(|record| record.0);
        records
    }

    /// Writes its log, with so many records in a chunk.
    pub(super) fn write(&self, path: &Path, chunk: usize) {
        let file = std::fs::File::create(path).unwrap();
        let options = mcap::WriteOptions::new().compression(None).chunk_size(None);
        let mut writer = options.create(file).unwrap();
        let scenario = self.scenario();
        let hash = format!("{:016x}", xxh3_64(scenario.as_bytes()));
        let head = [
            ("format", "1.3"),
            ("seed", "1"),
            ("scenario", "small/world"),
            ("scenario_hash", hash.as_str()),
            ("epoch_ns", "0"),
            ("exclude", "[]"),
        ];
        let end = END_NS.to_string();
        let write = |writer: &mut mcap::Writer<_>, name: &str, entries: &[(&str, &str)]| {
            let entries = entries.iter();
            let metadata = entries.map(|(key, value)| ((*key).to_owned(), (*value).to_owned()));
            let record = mcap::records::Metadata {
                name: name.to_owned(),
                metadata: metadata.collect(),
            };
            writer.write_metadata(&record).unwrap();
        };
        write(&mut writer, "farside", &head);
        let attachment = mcap::Attachment {
            log_time: 0,
            create_time: 0,
            name: crate::writer::SCENARIO_ATTACHMENT.to_owned(),
            media_type: "application/toml".to_owned(),
            data: scenario.into_bytes().into(),
        };
        writer.attach(&attachment).unwrap();
        for (at, (time_ns, topic, role, envelope)) in self.records().into_iter().enumerate() {
            let role: BTreeMap<String, String> = [("role".to_owned(), role.to_owned())].into();
            let channel = writer.add_channel(0, &topic, "protobuf", &role).unwrap();
            let header = MessageHeader {
                channel_id: channel,
                sequence: 0,
                log_time: time_ns,
                publish_time: time_ns,
            };
            writer.write_to_known_channel(&header, &envelope).unwrap();
            if at % chunk == chunk - 1 {
                writer.flush().unwrap();
            }
        }
        write(&mut writer, "farside.end", &[("end_time_ns", &end)]);
        writer.finish().unwrap();
    }
}

fn record(message: &Message) -> (u64, String, &'static str, Vec<u8>) {
    let (from, to) = (name(message.from), name(message.to));
    let mut out = Vec::new();
    put_text(&mut out, field::SENDER, &from);
    put_text(&mut out, field::RECEIVER, &to);
    put_text(&mut out, field::LINK, &link(message.from, message.to));
    put_text(&mut out, field::KIND, "Fact");
    let fate = if message.lost.is_some() {
        "lost"
    } else {
        "delivered"
    };
    put_text(&mut out, field::FATE, fate);
    put_text(&mut out, field::REASON, message.lost.unwrap_or(""));
    put_number(&mut out, field::ORDINAL, message.ordinal);
    put_number(&mut out, field::TIME_NS, message.at_ns);
    put_text(&mut out, field::SOURCE, &link(message.from, message.to));
    put_number(&mut out, field::COUNT, message.ordinal);
    put_number(&mut out, field::SENT_NS, message.sent_ns);
    let mut cause = Vec::new();
    put_number(&mut cause, 1, message.sent_ns);
    put_text(&mut cause, 3, &from);
    put_number(&mut cause, 4, message.tick);
    put_bytes(&mut out, field::CAUSE, &cause);
    put_bytes(&mut out, field::BODY, &message.body.to_le_bytes());
    let topic = match message.lost {
        Some(_) => format!("/lost/{from}/fact"),
        None => format!("/{from}/fact"),
    };
    (message.at_ns, topic, "message", out)
}
