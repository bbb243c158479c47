//! The comparer: outputs of the living actors beside the recorded ones.
//!
//! An output and its record come in either order: what becomes of a message is recorded when it becomes
//! clear, a state sample when its event is over. What came first waits. Two that were made at one instant in
//! one flow with one number or content belong together, or that have one match key; what is left at the end, by
//! its instant or its number.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use xxhash_rust::xxh3::xxh3_64;

use super::report::{Difference, KindTally, Output, OutputClass, Steps, Tally};
use super::trail::{Led, Trail};
use crate::engine::{FirstSample, Happened, Sink};
use crate::ids::{EntityId, MatchKey};
use crate::key::EventKey;
use crate::record::RecordClass;
use crate::time::SimTime;
use crate::topology::{FixedMap, Topology};

/// Which outputs are compared with each other.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct FlowKey {
    pub(super) class: OutputClass,
    pub(super) actor: EntityId,
    pub(super) receiver: EntityId,
    /// Its place among the names of kinds.
    pub(super) kind: u32,
}

/// An output as it is met.
pub(super) struct Seen<'a> {
    pub(super) ordinal: u64,
    pub(super) time: SimTime,
    pub(super) cause: EventKey,
    pub(super) match_key: Option<MatchKey>,
    pub(super) body: &'a [u8],
}

/// An output that waits for its counterpart.
struct Waiting {
    ordinal: u64,
    time: SimTime,
    cause: EventKey,
    match_key: Option<MatchKey>,
    hash: u64,
    body: Option<Box<[u8]>>,
    led: Option<Led>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    Recorded,
    Replayed,
}

struct Flow {
    key: FlowKey,
    left_out: bool,
    tally: Tally,
    /// What waits, of the record and of the replay, each in order of time and ordinal.
    waiting: [VecDeque<Waiting>; 2],
    /// Samples met, of the record and of the replay: they have no numbers of their own.
    met: [u64; 2],
}

/// So many of a flow wait at most.
const MOST_WAITING: usize = 1 << 16;

/// So many bytes of bodies wait at most: of what is more only hashes wait.
const MOST_BYTES: usize = 64 << 20;

/// The first difference so far, with what it is first by.
pub(super) type First = Option<((EventKey, u64), Difference)>;

pub(super) struct Comparer {
    pub(super) topology: Arc<Topology>,
    live: Vec<bool>,
    by_key: FixedMap<FlowKey, usize>,
    flows: Vec<Flow>,
    kinds: Vec<String>,
    /// The last kind that was looked up by its name.
    last_kind: u32,
    trail: Trail,
    waiting_bytes: usize,
    /// Events at instants that are not over: of the record more than of the replay.
    instants: BTreeMap<SimTime, i64>,
    pub(super) steps: Steps,
    first: First,
    differences: u64,
    left_out: Option<LeavesOut>,
}

/// Whether outputs are not compared, by what they are, whose and which kind.
type LeavesOut = Box<dyn Fn(OutputClass, &str, &str) -> bool + Send>;

impl Comparer {
    pub(super) fn new(topology: Arc<Topology>, live: Vec<bool>) -> Self {
        let kinds = topology.info.kinds.iter();
        Comparer {
            kinds: kinds.map(|kind| kind.name().to_owned()).collect(),
            topology,
            live,
            by_key: FixedMap::default(),
            flows: Vec::new(),
            last_kind: 0,
            trail: Trail::default(),
            waiting_bytes: 0,
            instants: BTreeMap::new(),
            steps: Steps::default(),
            first: None,
            differences: 0,
            left_out: None,
        }
    }

    pub(super) fn leave_out(
        &mut self,
        which: impl Fn(OutputClass, &str, &str) -> bool + Send + 'static,
    ) {
        self.left_out = Some(Box::new(which));
    }

    pub(super) fn leaves_out(&self, class: OutputClass, actor: EntityId, kind: &str) -> bool {
        let is_out = self.left_out.as_ref();
        is_out.is_some_and(|is_out| is_out(class, self.topology.name(actor), kind))
    }

    pub(super) fn is_live(&self, entity: EntityId) -> bool {
        self.live[entity.index()]
    }

    /// The number of a kind by its name.
    pub(super) fn kind_named(&mut self, name: &str) -> u32 {
        if self.kinds.get(self.last_kind as usize).map(String::as_str) != Some(name) {
            let known = self.kinds.iter().position(|known| known == name);
            let at = known.unwrap_or_else(|| {
                self.kinds.push(name.to_owned());
                self.kinds.len() - 1
            });
            self.last_kind = at as u32;
        }
        self.last_kind
    }

    fn flow(&mut self, key: FlowKey) -> usize {
        if let Some(at) = self.by_key.get(&key) {
            return *at;
        }
        let kind = &self.kinds[key.kind as usize];
        let left_out = self.leaves_out(key.class, key.actor, kind);
        self.flows.push(Flow {
            key,
            left_out,
            tally: Tally::default(),
            waiting: [VecDeque::new(), VecDeque::new()],
            met: [0; 2],
        });
        self.by_key.insert(key, self.flows.len() - 1);
        self.flows.len() - 1
    }

    /// An output of the record or of the replay.
    pub(super) fn meet(&mut self, side: Side, key: FlowKey, mut seen: Seen<'_>) {
        let at = self.flow(key);
        let flow = &mut self.flows[at];
        if flow.left_out {
            flow.tally.unsettled += u64::from(side == Side::Replayed);
            return;
        }
        if key.class == OutputClass::Sample {
            seen.ordinal = flow.met[side as usize];
            flow.met[side as usize] += 1;
        }
        let others = &mut flow.waiting[1 - side as usize];
        match partner(others, &seen).and_then(|at| others.remove(at)) {
            Some(other) => self.compare(at, side, &seen, other),
            None => self.wait(at, side, &seen),
        }
    }

    fn wait(&mut self, at: usize, side: Side, seen: &Seen<'_>) {
        let body = (self.waiting_bytes < MOST_BYTES).then(|| Box::<[u8]>::from(seen.body));
        self.waiting_bytes += body.as_ref().map_or(0, |body| body.len());
        let waiting = Waiting {
            ordinal: seen.ordinal,
            time: seen.time,
            cause: seen.cause,
            match_key: seen.match_key,
            hash: xxh3_64(seen.body),
            body,
            led: self.trail.find(seen.cause),
        };
        let list = &mut self.flows[at].waiting[side as usize];
        let order = (seen.time, seen.ordinal);
        let place = list.partition_point(|one| (one.time, one.ordinal) < order);
        list.insert(place, waiting);
        if list.len() > MOST_WAITING {
            let oldest = list.pop_front();
            let others = &mut self.flows[at].waiting[1 - side as usize];
            let other = oldest
                .as_ref()
                .and_then(|oldest| late_partner(others, oldest));
            let pair = [oldest, other];
            match side {
                Side::Recorded => self.settle(at, pair),
                Side::Replayed => {
                    let [replayed, recorded] = pair;
                    self.settle(at, [recorded, replayed]);
                }
            }
        }
    }

    /// Compares an output with the one that has waited for it.
    fn compare(&mut self, at: usize, side: Side, seen: &Seen<'_>, other: Waiting) {
        self.waiting_bytes -= other.body.as_ref().map_or(0, |body| body.len());
        let same_body = match &other.body {
            Some(body) => **body == *seen.body,
            None => other.hash == xxh3_64(seen.body),
        };
        let field = match () {
            () if other.time != seen.time => "sent",
            () if other.match_key != seen.match_key => "match_key",
            () if !same_body => "body",
            () => {
                self.flows[at].tally.same += 1;
                return;
            }
        };
        self.flows[at].tally.changed += 1;
        let own = Output {
            time: seen.time,
            ordinal: seen.ordinal,
            match_key: seen.match_key,
            body: Some(seen.body.to_vec()),
        };
        let led = self.trail.find(seen.cause);
        let cause = other.cause.min(seen.cause);
        let other_led = other.led;
        let other = output(other);
        let (expected, actual) = match side {
            Side::Recorded => (own, other),
            Side::Replayed => (other, own),
        };
        self.differ(
            at,
            field,
            (cause, led.or(other_led)),
            Some(expected),
            Some(actual),
        );
    }

    /// Counts what is recorded, of the replay, or both, and was found no counterpart for in time.
    fn settle(&mut self, at: usize, pair: [Option<Waiting>; 2]) {
        let bytes = |one: &Waiting| one.body.as_ref().map_or(0, |body| body.len());
        let bytes: usize = pair.iter().flatten().map(bytes).sum();
        self.waiting_bytes -= bytes;
        let causes = pair.iter().flatten().map(|one| one.cause);
        let Some(cause) = causes.min() else {
            return;
        };
        let led = pair.iter().rev().flatten().find_map(|one| one.led);
        let led = led.or_else(|| self.trail.find(cause));
        let tally = &mut self.flows[at].tally;
        let field = match &pair {
            [Some(recorded), Some(replayed)] => {
                tally.changed += 1;
                match () {
                    () if recorded.time != replayed.time => "sent",
                    () if recorded.match_key != replayed.match_key => "match_key",
                    () => "body",
                }
            }
            [Some(_), None] => {
                tally.missing += 1;
                "presence"
            }
            _ => {
                tally.extra += 1;
                "presence"
            }
        };
        let [expected, actual] = pair.map(|one| one.map(output));
        self.differ(at, field, (cause, led), expected, actual);
    }

    fn differ(
        &mut self,
        at: usize,
        field: &'static str,
        (cause, led): (EventKey, Option<Led>),
        expected: Option<Output>,
        actual: Option<Output>,
    ) {
        self.differences += 1;
        let order = (cause, self.differences);
        if self.first.as_ref().is_some_and(|(first, _)| *first < order) {
            return;
        }
        let FlowKey {
            class,
            actor,
            receiver,
            kind,
        } = self.flows[at].key;
        let name = |entity: EntityId| self.topology.name(entity).to_owned();
        let has_receiver = matches!(class, OutputClass::Message | OutputClass::Change);
        let difference = Difference {
            class,
            actor: name(actor),
            receiver: if has_receiver {
                name(receiver)
            } else {
                String::new()
            },
            kind: self.kinds[kind as usize].clone(),
            field,
            expected,
            actual,
            event: led.map(|led| led.event.told(&self.topology)),
            input: led.and_then(|led| Some(led.input?.told(&self.topology))),
        };
        self.first = Some((order, difference));
    }

    /// An event of a living actor happened, in the record or in the replay.
    pub(super) fn step(&mut self, side: Side, time: SimTime) {
        let (count, change) = match side {
            Side::Recorded => (&mut self.steps.recorded, 1),
            Side::Replayed => (&mut self.steps.replayed, -1),
        };
        *count += 1;
        let more = self.instants.entry(time).or_default();
        *more += change;
        if *more == 0 {
            self.instants.remove(&time);
        }
        // Both have passed what is before the first event of either that has no counterpart yet, but for
        // this many at most.
        const OPEN: usize = 1 << 16;
        if self.instants.len() > OPEN {
            self.pass_instant();
        }
    }

    fn pass_instant(&mut self) {
        if let Some((time, _)) = self.instants.pop_first() {
            self.steps.differing += 1;
            let first = self.steps.first.get_or_insert(time);
            *first = time.min(*first);
        }
    }

    /// Settles what waits; `is_over` says that the record is over, and not cut. Returns the tallies and the
    /// first difference.
    pub(super) fn close(&mut self, is_over: bool, last: SimTime) -> (Vec<KindTally>, First) {
        for at in 0..self.flows.len() {
            let [mut recorded, mut replayed] = std::mem::take(&mut self.flows[at].waiting);
            for recorded in std::mem::take(&mut recorded) {
                let other = late_partner(&mut replayed, &recorded);
                self.settle(at, [Some(recorded), other]);
            }
            let is_at_once = self.flows[at].key.class != OutputClass::Message;
            for replayed in replayed {
                // Of a record that is cut the fate may be missing.
                match is_over || is_at_once && replayed.time < last {
                    true => self.settle(at, [None, Some(replayed)]),
                    false => self.flows[at].tally.unsettled += 1,
                }
            }
        }
        while !self.instants.is_empty() {
            self.pass_instant();
        }
        let mut by_kind: BTreeMap<(String, OutputClass, String), (Tally, bool)> = BTreeMap::new();
        for flow in &self.flows {
            let (actor, kind) = (
                self.topology.name(flow.key.actor),
                &self.kinds[flow.key.kind as usize],
            );
            let key = (actor.to_owned(), flow.key.class, kind.clone());
            let (tally, left_out) = by_kind.entry(key).or_default();
            tally.add(&flow.tally);
            *left_out = flow.left_out;
        }
        let kinds = by_kind.into_iter();
        let kinds = kinds.map(|((actor, class, kind), (tally, left_out))| KindTally {
            actor,
            class,
            kind,
            tally,
            left_out,
        });
        (kinds.collect(), self.first.take())
    }

    fn output_of(&mut self, class: OutputClass, happened: &Happened<'_>) {
        let head = happened.head;
        let kind = match (happened.sample, head.kind()) {
            (Some(kind), _) => self.kind_named(kind.name()),
            (None, kind) => kind.unwrap_or_default(),
        };
        let key = FlowKey {
            class,
            actor: head.sender,
            receiver: head.receiver,
            kind,
        };
        let seen = Seen {
            ordinal: head.ordinal,
            time: head.sent(happened.key),
            cause: head.cause().unwrap_or(happened.key),
            match_key: head.match_key(),
            body: happened.body,
        };
        self.meet(Side::Replayed, key, seen);
    }
}

fn output(waiting: Waiting) -> Output {
    Output {
        time: waiting.time,
        ordinal: waiting.ordinal,
        match_key: waiting.match_key,
        body: waiting.body.map(Vec::from),
    }
}

/// The counterpart of what is seen, among what waits: with its match key or of its instant, and either its
/// number or its content. Of several at one instant the others may be yet to come.
fn partner(list: &VecDeque<Waiting>, seen: &Seen<'_>) -> Option<usize> {
    if list.is_empty() {
        return None;
    }
    let from = match seen.match_key {
        Some(_) => 0,
        None => list.partition_point(|one| one.time < seen.time),
    };
    let places = from..list.len();
    let is_candidate = |at: &usize| match seen.match_key {
        Some(key) => list[*at].match_key == Some(key),
        None => list[*at].match_key.is_none(),
    };
    let goes_on = |at: &usize| seen.match_key.is_some() || list[*at].time == seen.time;
    let candidates = || places.clone().take_while(goes_on).filter(is_candidate);
    let numbered = candidates().find(|at| list[*at].ordinal == seen.ordinal);
    numbered.or_else(|| {
        let hash = xxh3_64(seen.body);
        candidates().find(|at| list[*at].hash == hash && list[*at].time == seen.time)
    })
}

/// Takes the counterpart of what has waited in vain: with its match key, or of its instant, or with its number.
fn late_partner(list: &mut VecDeque<Waiting>, one: &Waiting) -> Option<Waiting> {
    let at = match one.match_key {
        Some(key) => list.iter().position(|other| other.match_key == Some(key))?,
        None => {
            let at_once = list.partition_point(|other| other.time < one.time);
            match list.get(at_once) {
                Some(other) if other.time == one.time => at_once,
                // In order of time they are in that of their ordinals, too.
                _ => list
                    .binary_search_by_key(&one.ordinal, |other| other.ordinal)
                    .ok()?,
            }
        }
    };
    match list[at].match_key == one.match_key {
        true => list.remove(at),
        false => None,
    }
}

impl Sink for Comparer {
    fn commit(&mut self, happened: &Happened<'_>) {
        let head = happened.head;
        let from_live = self.is_live(head.sender);
        match happened.class {
            RecordClass::Delivered if from_live && head.link().is_none() => {
                self.output_of(OutputClass::Message, happened);
            }
            RecordClass::Lost if from_live => self.output_of(OutputClass::Message, happened),
            RecordClass::Change if from_live => self.output_of(OutputClass::Change, happened),
            RecordClass::Sample => self.output_of(OutputClass::Sample, happened),
            _ => {}
        }
        let is_step = matches!(
            happened.class,
            RecordClass::Start
                | RecordClass::Delivered
                | RecordClass::Timer
                | RecordClass::Restart
                | RecordClass::Told
        );
        if is_step && self.is_live(head.receiver) {
            self.trail.push(happened);
            self.step(Side::Replayed, happened.key.time);
        }
    }

    fn first_sample(&mut self, _sample: FirstSample) {}

    fn paused(&self) -> bool {
        false
    }
}
