//! A model as a table, for the reactive case: states, what can happen in them, and what is decided
//! then.
//!
//! A state is what the [propositional](super::propositional) technology knows between two cycles, but
//! for what makes no difference: numbers of one class are alike, and of a token's latest end it only
//! counts whether it is near. What differs is kept in registers. In a state, statuses, goals, cancels
//! and ends that come near lead from node to node; at the last one stands what the cycle decides: the
//! next state, what began and ended, and from where its registers are filled. A node or a decision
//! that is not there yet is made by running the interpreter, once. Where the interpreter decided by
//! numbers or times that states do not tell apart, nothing is made, and it is run again.
//!
//! Plans that deliberative planners commit are not of the table: while there is one, the interpreter
//! decides.

mod classes;
mod key;

use std::collections::BTreeMap;
use std::sync::Arc;

use farside_planning::Ticks;
use farside_planning::model::{Model, PredicateId, Problem, TimelineId, Value};
use smallvec::SmallVec;
use thiserror::Error;

use super::propositional::state::{Far, Fars, Origin};
use super::propositional::{NotPropositional, Propositional};
use super::{
    Contract, Ended, Outcome, Plan, PlanService, Present, Refusal, ServiceCounters, Snapshot,
    Stale, Started, check,
};
use classes::{Classes, classes};
use key::{check_present, exact_ticks, is_far, key, longest};

/// Why a model does not become a table.
#[derive(Debug, Error)]
pub enum NotCompiled {
    /// The propositional technology does not hold it.
    #[error(transparent)]
    NotPropositional(#[from] NotPropositional),
    /// A rule asks of a type with too many numbers.
    #[error("{rule}: asks of {of}, which has too many numbers to sort into classes")]
    Numbers {
        /// The type.
        of: String,
        /// Where the rule stands, and its master.
        rule: String,
    },
    /// A rule asks of several measured numbers at once.
    #[error("{rule}: asks of several numbers at once")]
    Several {
        /// Where the rule stands, and its master.
        rule: String,
    },
    /// A condition that a token of the past may fulfil.
    #[error("{rule}: the condition at {place} may be of a token that ended before")]
    Past {
        /// Where the rule stands, and its master.
        rule: String,
        /// Where the condition stands.
        place: String,
    },
    /// More timelines, predicates or classes than can be numbered.
    #[error("{what}: {actual}, expected {expected} at most")]
    TooMany {
        /// Of what.
        what: String,
        /// How many there may be.
        expected: u64,
        /// How many there are.
        actual: u64,
    },
}

/// How large a table is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TableSize {
    /// States.
    pub states: usize,
    /// What can be posted in them, one after another.
    pub nodes: usize,
    /// What is decided: one for each set of stimuli that a state has met.
    pub transitions: usize,
    /// All of it, with the interpreter's copies that new entries are made from.
    pub bytes: usize,
    /// The part that cycles read.
    pub table_bytes: usize,
    /// Cycles that the interpreter decided.
    pub interpreted: u64,
}

/// From where a register is filled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Source {
    Value(Option<Value>),
    Cell(u16),
    Posted(u16, u16),
}

/// From where a bound of an end is.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Bound {
    Never,
    Ahead(Ticks),
    End(u16),
    /// The latest of some for an earliest end, the earliest for a latest.
    Several(Box<[Far]>),
}

/// A token that begins or ends.
struct Change {
    timeline: u16,
    predicate: PredicateId,
    parameters: SmallVec<[Source; 4]>,
}

/// What a cycle decides. All of it stands in one row of numbers, so that few lines of memory are
/// read: how many cells, ends and tokens there are, from where each is filled, and tokens with what
/// they say.
#[derive(Clone, Debug)]
struct Transition {
    next: u32,
    code: Box<[u32]>,
    decisions: u32,
    guards: u32,
    backtracks: u32,
}

/// The highest bits of a number say what it is.
const KIND: u32 = 30;
const REST: u32 = (1 << KIND) - 1;

/// Values and times that transitions name by their places.
#[derive(Clone, Debug, Default)]
struct Names {
    values: Vec<Option<Value>>,
    value_places: BTreeMap<Option<Value>, u32>,
    several: Vec<Box<[Far]>>,
}

impl Names {
    fn source(&mut self, source: Source) -> u32 {
        match source {
            Source::Value(value) => {
                let next = self.values.len() as u32;
                let place = *self.value_places.entry(value).or_insert(next);
                if place == next {
                    self.values.push(value);
                }
                place
            }
            Source::Cell(cell) => 1 << KIND | u32::from(cell),
            Source::Posted(which, place) => 2 << KIND | u32::from(which) << 8 | u32::from(place),
        }
    }

    fn bound(&mut self, bound: Bound) -> u32 {
        match bound {
            Bound::Never => 2 << KIND,
            Bound::Ahead(ticks) => ticks as u32,
            Bound::End(end) => 1 << KIND | u32::from(end),
            Bound::Several(all) => {
                let known = self.several.iter().position(|at| *at == all);
                let place = known.unwrap_or(self.several.len());
                if place == self.several.len() {
                    self.several.push(all);
                }
                3 << KIND | place as u32
            }
        }
    }
}

/// What may be posted next.
#[derive(Clone, Debug, Default)]
struct Node {
    children: SmallVec<[(u64, u32); 1]>,
    transition: Option<u32>,
}

/// A state's part that is the same whatever its registers hold.
struct Form {
    node: u32,
    lanes: Box<[(PredicateId, SmallVec<[u16; 4]>)]>,
    ends: Box<[bool]>,
    /// The ends of which a bound is far.
    far: SmallVec<[u16; 8]>,
    /// By timeline: its token's end, and how long its own rules let it last at most.
    lasts: Box<[(u16, Ticks)]>,
    /// To be filled from the registers, and run.
    interpreter: Box<Propositional>,
}

/// What was posted in this cycle.
#[derive(Clone, Debug)]
enum Posted {
    Status(Contract, SmallVec<[Option<Value>; 4]>, bool),
    Goal(TimelineId, PredicateId, SmallVec<[Option<Value>; 4]>),
    Cancel(Contract),
}

impl Posted {
    fn values(&self) -> &[Option<Value>] {
        match self {
            Posted::Status(_, values, _) | Posted::Goal(_, _, values) => values,
            Posted::Cancel(_) => &[],
        }
    }
}

/// The registers of a state.
#[derive(Clone, Debug, Default)]
struct Registers {
    cells: Vec<Option<Value>>,
    /// The earliest and the latest tick of each end.
    ends: Vec<(Ticks, Ticks)>,
}

/// A model as a table that grows as it is used.
///
/// ```
/// use std::sync::Arc;
/// use farside_idea::service::{Outcome, PlanService, compiled::Compiled};
/// use farside_planning::language::{Options, read_model};
/// # let text = include_str!("../../../planning/models/polling.ddl");
/// let model = read_model("polling.ddl", text, &Options::default()).value.expect("it is right");
/// let mut service = Compiled::new(Arc::new(model)).expect("it can be a table");
/// for tick in 0..1_000 {
///     service.advance(tick);
///     if tick > 0 {
///         let poll = service.present(0).expect("it polls").contract;
///         service.bind(poll, &[None, Some(250 + tick % 100), Some(1)], true).expect("it can be");
///     }
///     assert_eq!(service.solve(1, 10_000), Outcome::Decided);
/// }
/// assert!(service.size().interpreted < 10);
/// ```
pub struct Compiled {
    model: Arc<Model>,
    classes: Vec<Classes>,
    /// By type: how many classes there are.
    counts: Vec<u64>,
    exact: Ticks,
    forms: Vec<Form>,
    by_key: BTreeMap<Vec<u32>, u32>,
    nodes: Vec<Node>,
    transitions: Vec<Transition>,
    names: Names,
    /// The state; none, while the interpreter is asked.
    state: u32,
    /// Where what was posted leads; none, if there is no such node.
    node: Option<u32>,
    posted: Vec<Posted>,
    registers: Registers,
    spare: Registers,
    starts: Vec<Ticks>,
    numbers: Vec<u64>,
    /// By timeline: whether a status of this cycle ended its token.
    ends: Vec<bool>,
    /// From when on a far end is near.
    near: Ticks,
    now: Ticks,
    solved: Option<Ticks>,
    /// Who decides, if not the table.
    interpreter: Option<Box<Propositional>>,
    started: Vec<Started>,
    ended: Vec<Ended>,
    counters: ServiceCounters,
    /// What the interpreter had spent when it was woken.
    base: ServiceCounters,
    interpreted: u64,
}

/// The most nodes of a table: then it grows no more.
const MOST_NODES: usize = 1 << 20;

/// What a node's child is asked by: what is posted, as far as it makes a difference.
const STATUS: u64 = 1;
const GOAL: u64 = 2;
const CANCEL: u64 = 3;
const NEAR: u64 = 4;
/// How many bits of a child's number are left for classes.
const CLASS_BITS: u32 = 36;

impl Compiled {
    /// With nothing on its timelines yet: the first cycle puts their defaults there.
    ///
    /// # Errors
    ///
    /// If the propositional technology does not hold the model, or its numbers or times cannot be
    /// sorted into classes.
    pub fn new(model: Arc<Model>) -> Result<Self, NotCompiled> {
        Compiled::begin(model, &Problem::default())
    }

    /// With what a problem says is the case at the start.
    ///
    /// # Errors
    ///
    /// As [`new`](Compiled::new), and if a fact cannot be, with those before it.
    pub fn begin(model: Arc<Model>, problem: &Problem) -> Result<Self, NotCompiled> {
        let mut interpreter = Propositional::begin(model.clone(), problem)?;
        check_present(&interpreter.tables)?;
        let exact = exact_ticks(&interpreter.tables);
        interpreter.world.state.exact = exact;
        let classes = classes(&interpreter.tables)?;
        let counts: Vec<u64> = classes.iter().map(|at| at.count(&model)).collect();
        check_counts(&model, &counts)?;
        let timelines = model.timelines.len();
        Ok(Compiled {
            model,
            classes,
            counts,
            exact,
            forms: Vec::new(),
            by_key: BTreeMap::new(),
            nodes: Vec::new(),
            transitions: Vec::new(),
            names: Names::default(),
            state: 0,
            node: None,
            posted: Vec::new(),
            registers: Registers::default(),
            spare: Registers::default(),
            starts: vec![0; timelines],
            numbers: vec![0; timelines],
            ends: vec![false; timelines],
            near: Ticks::MAX,
            now: 0,
            solved: None,
            interpreter: Some(Box::new(interpreter)),
            started: Vec::new(),
            ended: Vec::new(),
            counters: ServiceCounters::default(),
            base: ServiceCounters::default(),
            interpreted: 0,
        })
    }

    /// From the start again, with the table as it is by now.
    ///
    /// # Errors
    ///
    /// As [`new`](Compiled::new).
    pub fn restarted(self) -> Result<Self, NotCompiled> {
        let fresh = Compiled::new(self.model.clone())?;
        Ok(Compiled {
            forms: self.forms,
            by_key: self.by_key,
            nodes: self.nodes,
            transitions: self.transitions,
            names: self.names,
            ..fresh
        })
    }

    /// How large the table is by now.
    pub fn size(&self) -> TableSize {
        let nodes: usize = { self.nodes.iter() }
            .map(|at| {
                let spilled = if at.children.spilled() {
                    at.children.capacity()
                } else {
                    0
                };
                size_of::<Node>() + spilled * size_of::<(u64, u32)>()
            })
            .sum();
        let transitions: usize = { self.transitions.iter() }
            .map(|at| size_of::<Transition>() + size_of_val(&*at.code))
            .sum();
        let forms: usize = { self.forms.iter() }
            .map(|at| size_of::<Form>() + size_of_val(&*at.lanes) + size_of_val(&*at.ends))
            .sum();
        let keys: usize = self.by_key.keys().map(|key| 24 + 4 * key.len()).sum();
        let copies: usize = { self.forms.iter() }.map(|at| at.interpreter.bytes()).sum();
        TableSize {
            states: self.forms.len(),
            nodes: self.nodes.len(),
            transitions: self.transitions.len(),
            bytes: nodes + transitions + forms + keys + copies,
            table_bytes: nodes + transitions + forms,
            interpreted: self.interpreted,
        }
    }

    /// The number of what is posted, for its node.
    fn number(
        &self,
        kind: u64,
        timeline: usize,
        predicate: PredicateId,
        ends: bool,
        (first, values): (usize, &[Option<Value>]),
    ) -> u64 {
        let parameters = &self.model.predicates[predicate].parameters[first..];
        let mut mixed = 0;
        for (value, parameter) in values.iter().zip(parameters) {
            let classes = &self.classes[parameter.of];
            let count = self.counts[parameter.of] + 1;
            let class = value.map_or(0, |value| 1 + u64::from(classes.of(value)));
            mixed = mixed * count + class;
        }
        let predicate = if kind == GOAL { predicate as u64 } else { 0 };
        kind << 61
            | (timeline as u64) << 49
            | predicate << 37
            | u64::from(ends) << CLASS_BITS
            | mixed
    }

    /// What the token of an active contract says, as far as the table knows.
    fn on_table(&self, contract: Contract) -> Result<Option<PredicateId>, Refusal> {
        if self.node.is_none() {
            return Ok(None);
        }
        let timeline = usize::from(contract.timeline);
        if self.numbers.get(timeline) != Some(&contract.number) || self.ends[timeline] {
            return Err(check::dead(&self.model, contract));
        }
        Ok(Some(self.forms[self.state as usize].lanes[timeline].0))
    }

    fn child(&self, number: u64) -> Option<u32> {
        let node = &self.nodes[self.node? as usize];
        let child = node.children.iter().find(|child| child.0 == number);
        child.map(|&(_, child)| child)
    }

    /// The interpreter, with what was posted in this cycle.
    fn wake(&mut self) -> &mut Propositional {
        if self.interpreter.is_none() {
            let mut interpreter = self.forms[self.state as usize].interpreter.clone();
            interpreter.advance(self.now);
            interpreter.posted = 0;
            self.base = interpreter.counters();
            self.fill(&mut interpreter);
            for posted in &self.posted {
                let again = post(&mut interpreter, posted);
                debug_assert!(again.is_ok(), "it was taken before: {again:?}");
            }
            self.interpreter = Some(interpreter);
        }
        self.interpreter.as_mut().expect("it was made")
    }

    /// Fills a state's form from its registers.
    fn fill(&self, interpreter: &mut Propositional) {
        let state = &mut interpreter.world.state;
        state.exact = self.exact;
        state.loose.set(false);
        for (place, (known, value)) in { state.cells.iter_mut() }
            .zip(&self.registers.cells)
            .enumerate()
        {
            (known.value, known.origin) = (*value, Origin::Cell(place as u16));
        }
        let ends = state.finishes.iter_mut().zip(&self.registers.ends);
        for (place, (bounds, &(min, max))) in ends.enumerate() {
            let from = |time: Ticks| -> Fars {
                let far = is_far(time, self.now, self.exact);
                { far.then_some(Far::End(place as u16)) }
                    .into_iter()
                    .collect()
            };
            (bounds.min, bounds.max) = (min, max);
            (bounds.lows, bounds.highs) = (from(min), from(max));
        }
        for (timeline, lane) in state.lanes.iter_mut().enumerate() {
            lane.number = self.numbers[timeline];
            if let Some(&token) = lane.tokens.last() {
                state.tokens[usize::from(token)].start = self.starts[timeline];
            }
        }
    }

    /// Something is posted: along the table, or to the interpreter, which makes a new node.
    fn post(&mut self, number: u64, posted: Posted) -> Result<(), Refusal> {
        if self.interpreter.is_none()
            && let Some(child) = self.child(number)
        {
            self.node = Some(child);
            self.posted.push(posted);
            return Ok(());
        }
        let interpreter = self.wake();
        let outcome = post(interpreter, &posted);
        let loose = interpreter.world.state.loose.get();
        // What is refused leaves no trace, and is refused by the interpreter again.
        if outcome.is_ok() {
            self.posted.push(posted);
            self.node = match self.node {
                Some(_) if loose => None,
                Some(node) => self.child(number).or_else(|| self.add_node(node, number)),
                None => None,
            };
        }
        outcome
    }

    fn add_node(&mut self, parent: u32, number: u64) -> Option<u32> {
        if self.nodes.len() >= MOST_NODES {
            return None;
        }
        let child = self.nodes.len() as u32;
        self.nodes.push(Node::default());
        self.nodes[parent as usize].children.push((number, child));
        Some(child)
    }

    /// Far ends that are near now are the first that is posted.
    fn come_near(&mut self) {
        let far = &self.forms[self.state as usize].far;
        let (mut which, mut near, mut bit) = (0_u64, Ticks::MAX, 0);
        for &end in far {
            let bounds = self.registers.ends[usize::from(end)];
            for bound in [bounds.0, bounds.1] {
                let was = is_far(bound, self.now - 1, self.exact);
                if was && !is_far(bound, self.now, self.exact) {
                    which |= 1 << bit;
                }
                bit += 1;
            }
            near = near.min(comes_near(bounds, self.now, self.exact));
        }
        // How a token ends whose time is nearly over depends on whose time it is.
        for (timeline, &(end, longest)) in self.forms[self.state as usize].lasts.iter().enumerate()
        {
            let (_, max) = self.registers.ends[usize::from(end)];
            if self.starts[timeline].saturating_add(longest) == max {
                which |= 1 << bit;
            }
            bit += 1;
        }
        if bit > 60 {
            self.node = None;
        }
        self.near = near;
        let number = NEAR << 61 | which;
        self.node = match (self.child(number), self.node) {
            (Some(child), _) => Some(child),
            (None, Some(node)) => self.add_node(node, number),
            (None, None) => None,
        };
    }

    /// What the table says is decided.
    fn follow(&mut self, transition: u32) {
        let at = &self.transitions[transition as usize];
        let (now, from, names) = (self.now, &self.registers, &self.names);
        let posted = &self.posted;
        let value = |source: &u32| {
            let rest = source & REST;
            match source >> KIND {
                0 => names.values[rest as usize],
                1 => from.cells[rest as usize],
                _ => posted[(rest >> 8) as usize].values()[(rest & 0xff) as usize],
            }
        };
        let end = |at: &Far, max: bool| match *at {
            Far::Ahead(ticks) => now + ticks,
            Far::End(end) if max => from.ends[usize::from(end)].1,
            Far::End(end) => from.ends[usize::from(end)].0,
        };
        let bound = |bound: u32, max: bool| match bound >> KIND {
            0 => now + Ticks::from(bound & REST),
            1 => end(&Far::End((bound & REST) as u16), max),
            2 => Ticks::MAX,
            _ => {
                let all = &names.several[(bound & REST) as usize];
                let all = all.iter().map(|at| end(at, max));
                { if max { all.min() } else { all.max() } }.unwrap_or(now)
            }
        };
        let (counts, code) = at.code.split_at(4);
        let (cells, code) = code.split_at(counts[0] as usize);
        let (ends, mut code) = code.split_at(2 * counts[1] as usize);
        for change in 0..counts[2] + counts[3] {
            let (timeline, predicate) = ((code[0] >> 16) as u16, (code[0] & 0xffff) as usize);
            let (parameters, rest) = code[2..].split_at(code[1] as usize);
            code = rest;
            let lane = usize::from(timeline);
            let parameters = parameters.iter().map(value).collect();
            if change < counts[2] {
                let number = self.numbers[lane];
                self.ended.push(Ended {
                    contract: Contract { timeline, number },
                    predicate,
                    start: self.starts[lane],
                    finish: now,
                    parameters,
                });
                continue;
            }
            self.numbers[lane] += 1;
            self.starts[lane] = now;
            let number = self.numbers[lane];
            self.started.push(Started {
                contract: Contract { timeline, number },
                predicate,
                parameters,
            });
        }
        self.spare.cells.clear();
        self.spare.cells.extend(cells.iter().map(value));
        self.spare.ends.clear();
        let mut near = Ticks::MAX;
        for pair in ends.chunks_exact(2) {
            let bounds = (bound(pair[0], false), bound(pair[1], true));
            near = near.min(comes_near(bounds, now, self.exact));
            self.spare.ends.push(bounds);
        }
        self.near = near;
        self.counters.decisions += u64::from(at.decisions);
        self.counters.guards += u64::from(at.guards);
        self.counters.backtracks += u64::from(at.backtracks);
        self.state = at.next;
        std::mem::swap(&mut self.registers, &mut self.spare);
        self.settle_state();
    }

    /// A state is entered: nothing is posted in it yet.
    fn settle_state(&mut self) {
        let form = &self.forms[self.state as usize];
        self.node = Some(form.node);
        self.ends.copy_from_slice(&form.ends);
        self.posted.clear();
        self.solved = Some(self.now);
    }

    /// What the interpreter decided becomes a state, and, if it may, a transition to it.
    fn learn(&mut self, interpreter: Box<Propositional>, before: ServiceCounters) {
        let loose = interpreter.world.state.loose.get();
        let ended = self.changes_of(&interpreter, true);
        let asks = interpreter.world.state.open.len();
        let mut stripped = interpreter.clone();
        stripped.world.compact(1);
        let planned = stripped.world.plans.iter().any(Option::is_some);
        let key = key(&stripped, &self.classes, self.exact);
        let (Some(key), false) = (key, planned || asks != stripped.world.state.open.len()) else {
            // It goes on alone.
            interpreter.world.state.loose.set(false);
            (self.node, self.interpreter) = (None, Some(interpreter));
            self.posted.clear();
            return;
        };
        let next = match self.by_key.get(&key) {
            Some(&next) => next,
            None => self.add_form(key, &stripped),
        };
        let spent = interpreter.counters();
        if let (Some(node), Some(ended), false) = (self.node, ended, loose)
            && let Some(started) = self.changes_of(&stripped, false)
            && let Some(code) = self.encode(&stripped, (ended, started))
        {
            self.nodes[node as usize].transition = Some(self.transitions.len() as u32);
            self.transitions.push(Transition {
                next,
                code,
                decisions: (spent.decisions - before.decisions) as u32,
                guards: (spent.guards - before.guards) as u32,
                backtracks: (spent.backtracks - before.backtracks) as u32,
            });
        }
        self.read(&stripped, next);
    }

    /// The registers of a state that the interpreter is in.
    fn read(&mut self, is: &Propositional, state: u32) {
        let known = &is.world.state;
        self.registers.cells.clear();
        self.registers
            .cells
            .extend(known.cells.iter().map(|at| at.value));
        self.registers.ends.clear();
        self.registers
            .ends
            .extend(known.finishes.iter().map(|at| (at.min, at.max)));
        for (timeline, lane) in known.lanes.iter().enumerate() {
            self.numbers[timeline] = lane.number;
            if let Some(&token) = lane.tokens.last() {
                self.starts[timeline] = known.at(token).start;
            }
        }
        let far = known
            .finishes
            .iter()
            .filter(|at| is_far(at.max, self.now, self.exact));
        self.near = far
            .map(|at| at.max - self.exact)
            .min()
            .unwrap_or(Ticks::MAX);
        self.state = state;
        self.settle_state();
    }

    fn add_form(&mut self, key: Vec<u32>, is: &Propositional) -> u32 {
        let node = self.nodes.len() as u32;
        self.nodes.push(Node::default());
        let known = &is.world.state;
        let lanes = known.lanes.iter().map(|lane| {
            let token = lane.tokens.last().expect("each timeline says something");
            let at = known.at(*token);
            (at.predicate, at.parameters.iter().copied().collect())
        });
        let ends = 0..known.finishes.len();
        let far = ends.filter(|&at| {
            let at = &known.finishes[at];
            known.is_far(at.min) || known.is_far(at.max)
        });
        let lasts = known.lanes.iter().enumerate().map(|(timeline, lane)| {
            let token = lane.tokens.last().expect("each timeline says something");
            let longest = longest(is, timeline).unwrap_or(Ticks::MAX);
            (known.end(known.at(*token).finish), longest)
        });
        let mut interpreter = Box::new(is.clone());
        interpreter.shrink();
        self.forms.push(Form {
            node,
            lanes: lanes.collect(),
            ends: is.ends.clone().into(),
            far: far.map(|at| at as u16).collect(),
            lasts: lasts.collect(),
            interpreter,
        });
        let state = (self.forms.len() - 1) as u32;
        self.by_key.insert(key, state);
        state
    }

    /// What began or ended, with where its parameters are from; none, if that is not clear.
    fn changes_of(&self, is: &Propositional, ended: bool) -> Option<Vec<Change>> {
        let known = &is.world.state;
        let mut changes = Vec::new();
        for (timeline, lane) in known.lanes.iter().enumerate() {
            let token = match (ended, &lane.tokens[..]) {
                (true, &[.., before, present]) if known.at(present).start == self.now => before,
                (false, &[.., present]) if known.at(present).start == self.now => present,
                _ => continue,
            };
            let at = known.at(token);
            if ended && known.finish(token).1 != self.now {
                return None;
            }
            let parameters = at.parameters.iter().map(|&cell| source(is, cell));
            changes.push(Change {
                timeline: timeline as u16,
                predicate: at.predicate,
                parameters: parameters.collect(),
            });
        }
        Some(changes)
    }

    /// From where a state's registers are filled, and what began and ended, as a row of numbers;
    /// none, if it is not clear.
    fn encode(
        &mut self,
        is: &Propositional,
        (ended, started): (Vec<Change>, Vec<Change>),
    ) -> Option<Box<[u32]>> {
        let known = &is.world.state;
        let counts = [
            known.cells.len(),
            known.finishes.len(),
            ended.len(),
            started.len(),
        ];
        let mut code: Vec<u32> = counts.iter().map(|&at| at as u32).collect();
        for cell in 0..known.cells.len() {
            code.push(self.names.source(source(is, cell as u16)));
        }
        for at in &known.finishes {
            for (time, fars) in [(at.min, &at.lows), (at.max, &at.highs)] {
                let bound = match (time, &fars[..]) {
                    (Ticks::MAX, _) => Bound::Never,
                    (time, _) if !known.is_far(time) => Bound::Ahead((time - self.now).max(0)),
                    (_, []) => return None,
                    (_, &[Far::Ahead(ticks)]) if ticks > Ticks::from(REST) => return None,
                    (_, &[Far::Ahead(ticks)]) => Bound::Ahead(ticks),
                    (_, &[Far::End(end)]) => Bound::End(end),
                    (_, several) => Bound::Several(several.into()),
                };
                code.push(self.names.bound(bound));
            }
        }
        for change in ended.into_iter().chain(started) {
            code.push(u32::from(change.timeline) << 16 | change.predicate as u32);
            code.push(change.parameters.len() as u32);
            code.extend(
                change
                    .parameters
                    .into_iter()
                    .map(|at| self.names.source(at)),
            );
        }
        Some(code.into())
    }

    /// The interpreter decides.
    fn interpret(&mut self, horizon: Ticks, budget: u64) -> Outcome {
        self.interpreted += 1;
        let interpreter = self.wake();
        let before = interpreter.counters();
        let outcome = interpreter.solve(horizon, budget);
        let after = interpreter.counters();
        let Some(interpreter) = self.interpreter.take() else {
            return outcome;
        };
        self.started.extend_from_slice(interpreter.started());
        self.ended.extend_from_slice(interpreter.ended());
        let base = std::mem::replace(&mut self.base, after);
        self.counters.operations += after.operations - base.operations;
        self.counters.decisions += after.decisions - before.decisions;
        self.counters.guards += after.guards - before.guards;
        self.counters.backtracks += after.backtracks - before.backtracks;
        match outcome {
            Outcome::Decided => self.learn(interpreter, before),
            _ => (self.node, self.interpreter) = (None, Some(interpreter)),
        }
        outcome
    }
}

/// From which tick on a bound of an end is near that is far now.
fn comes_near((min, max): (Ticks, Ticks), now: Ticks, exact: Ticks) -> Ticks {
    let far = [min, max].into_iter().filter(|&at| is_far(at, now, exact));
    far.map(|at| at - exact).min().unwrap_or(Ticks::MAX)
}

/// Whether what may be posted can be numbered.
fn check_counts(model: &Model, counts: &[u64]) -> Result<(), NotCompiled> {
    let check = |what: &str, expected: u64, actual: u64| {
        if actual <= expected {
            return Ok(());
        }
        let what = what.to_owned();
        Err(NotCompiled::TooMany {
            what,
            expected,
            actual,
        })
    };
    check("timelines", 1 << 12, model.timelines.len() as u64)?;
    check("predicates", 1 << 12, model.predicates.len() as u64)?;
    for predicate in &model.predicates {
        for places in [
            0..predicate.inputs,
            predicate.inputs..predicate.parameters.len(),
        ] {
            let parameters = predicate.parameters[places].iter();
            let all = parameters.map(|at| counts[at.of] + 1);
            let all = all.fold(1, u64::saturating_mul);
            let what = format!("classes of what {} says", predicate.name);
            check(&what, 1 << CLASS_BITS, all)?;
        }
    }
    Ok(())
}

/// Posts something to the interpreter.
fn post(interpreter: &mut Propositional, posted: &Posted) -> Result<(), Refusal> {
    match posted {
        Posted::Status(contract, values, ends) => interpreter.bind(*contract, values, *ends),
        Posted::Goal(timeline, predicate, values) => {
            let inputs: SmallVec<[Value; 4]> = values.iter().copied().flatten().collect();
            interpreter.insert_goal(*timeline, *predicate, &inputs)
        }
        Posted::Cancel(contract) => interpreter.cancel(*contract),
    }
}

/// From where a cell has its value.
fn source(is: &Propositional, cell: u16) -> Source {
    let known = &is.world.state.cells[usize::from(is.world.state.root(cell))];
    match (known.value, known.origin) {
        (None, _) | (_, Origin::Model | Origin::Computed) => Source::Value(known.value),
        (_, Origin::Cell(cell)) => Source::Cell(cell),
        (_, Origin::Posted(which, place)) => Source::Posted(which, place),
    }
}

impl PlanService for Compiled {
    fn model(&self) -> &Arc<Model> {
        &self.model
    }

    fn advance(&mut self, now: Ticks) {
        let again = now <= self.now && self.solved != Some(now);
        if self.interpreter.is_none() && !again {
            self.now = now.max(self.now);
            if self.solved.is_none_or(|solved| solved + 1 != self.now) {
                // Only from tick to tick is a table right.
                self.node = None;
                self.wake();
            } else if self.now >= self.near {
                self.come_near();
            }
        }
        self.now = now.max(self.now);
        if let Some(interpreter) = &mut self.interpreter {
            interpreter.advance(self.now);
        }
    }

    fn bind(
        &mut self,
        contract: Contract,
        outputs: &[Option<Value>],
        ends: bool,
    ) -> Result<(), Refusal> {
        let timeline = usize::from(contract.timeline);
        let number = match self.on_table(contract)? {
            Some(predicate) => {
                check::values(&self.model, predicate, "outputs", outputs)?;
                let inputs = self.model.predicates[predicate].inputs;
                self.number(STATUS, timeline, predicate, ends, (inputs, outputs))
            }
            None => 0,
        };
        let outputs = SmallVec::from_slice(outputs);
        self.post(number, Posted::Status(contract, outputs, ends))?;
        if let Some(at) = self.ends.get_mut(timeline) {
            *at |= ends;
        }
        Ok(())
    }

    fn insert_goal(
        &mut self,
        timeline: TimelineId,
        predicate: PredicateId,
        inputs: &[Value],
    ) -> Result<(), Refusal> {
        check::predicate(&self.model, timeline, predicate)?;
        let values: SmallVec<[Option<Value>; 4]> = inputs.iter().copied().map(Some).collect();
        check::values(&self.model, predicate, "inputs", &values)?;
        let number = self.number(GOAL, timeline, predicate, false, (0, &values));
        self.post(number, Posted::Goal(timeline, predicate, values))
    }

    fn cancel(&mut self, contract: Contract) -> Result<(), Refusal> {
        let timeline = usize::from(contract.timeline);
        let number = match self.on_table(contract)? {
            Some(predicate) => self.number(CANCEL, timeline, predicate, false, (0, &[])),
            None => 0,
        };
        self.post(number, Posted::Cancel(contract))
    }

    fn solve(&mut self, horizon: Ticks, budget: u64) -> Outcome {
        self.started.clear();
        self.ended.clear();
        let spent = 1 + self.posted.len() as u64;
        let known = { self.node.filter(|_| self.interpreter.is_none()) }
            .and_then(|node| self.nodes[node as usize].transition);
        match known {
            Some(_) if spent > budget => {
                // What was posted stands, and the interpreter keeps it.
                self.wake();
                self.node = None;
                Outcome::OverBudget
            }
            Some(transition) => {
                self.counters.operations += spent;
                self.follow(transition);
                Outcome::Decided
            }
            None => self.interpret(horizon, budget),
        }
    }

    fn started(&self) -> &[Started] {
        &self.started
    }

    fn ended(&self) -> &[Ended] {
        &self.ended
    }

    fn present(&self, timeline: TimelineId) -> Option<Present> {
        if let Some(interpreter) = &self.interpreter {
            return interpreter.present(timeline);
        }
        let (predicate, cells) = self.forms[self.state as usize].lanes.get(timeline)?;
        let parameters = cells
            .iter()
            .map(|&cell| self.registers.cells[usize::from(cell)]);
        Some(Present {
            contract: Contract {
                timeline: timeline as u16,
                number: self.numbers[timeline],
            },
            predicate: *predicate,
            start: self.starts[timeline],
            parameters: parameters.collect(),
        })
    }

    /// Nothing is left to forget: no more than the present is ever kept.
    fn forget(&mut self, _before: Ticks) {}

    fn counters(&self) -> ServiceCounters {
        ServiceCounters {
            tokens: self.numbers.len() as u64,
            ..self.counters
        }
    }

    fn now(&self) -> Ticks {
        self.now
    }

    fn commit(&mut self, snapshot: &Snapshot, plan: Plan) -> Result<(), Stale> {
        self.node = None;
        self.wake().commit(snapshot, plan)
    }

    fn drop_plan(&mut self, timeline: TimelineId) {
        if let Some(interpreter) = &mut self.interpreter {
            interpreter.drop_plan(timeline);
        }
    }
}
