//! A model as a table, for the reactive case: states, what can happen in them, and what is decided
//! then.
//!
//! A state is what the [propositional](super::propositional) technology knows between two cycles, but
//! for what makes no difference: numbers of one class are alike, and of a far end it only counts that
//! it is far. What differs is kept in registers, which stay where they are from state to state. In a
//! state, statuses, goals, cancels and ends that come near lead from node to node; at the last one
//! stands what the cycle decides: the next state, and an effect, which is what began and ended, and
//! which registers are filled from where. Effects are few: many nodes have the same. A node or a decision
//! that is not there yet is made by running the interpreter, once. Where the interpreter decided by
//! numbers or times that states do not tell apart, nothing is made, and it is run again.
//!
//! Plans that deliberative planners commit are not of the table: while there is one, the interpreter
//! decides.

mod changes;
mod classes;
mod key;
mod learn;
mod table;
mod walk;

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
use changes::Recent;
pub use changes::{Began, Row};
use classes::{Slots, Sorts, classes};
use key::{check_present, exact_ticks, is_far};
use table::{Lane, NONE, Posted, Registers, Table, What};

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
    /// What transitions do, with those counted once that do the same.
    pub effects: usize,
    /// All of it, with the interpreter's copies that new entries are made from.
    pub bytes: usize,
    /// The part that cycles read.
    pub table_bytes: usize,
    /// Cycles that the interpreter decided.
    pub interpreted: u64,
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
    sorts: Sorts,
    slots: Slots,
    exact: Ticks,
    table: Table,
    /// The state; none, while the interpreter is asked.
    state: u32,
    /// Where what was posted leads; none, if there is no such node.
    node: Option<u32>,
    posted: Vec<Posted>,
    registers: Registers,
    /// The effect whose registers are still to be filled; [`NONE`] without.
    pending: u32,
    /// Kept for its memory.
    spare: Registers,
    /// By timeline.
    lanes: Vec<Lane>,
    /// From when on a far end is near; not later than that.
    near: Ticks,
    now: Ticks,
    solved: Option<Ticks>,
    /// Who decides, if not the table.
    interpreter: Option<Box<Propositional>>,
    recent: Recent,
    /// Of which effect the lists are; [`NONE`], if of none.
    listed: u32,
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
        let interpreter = Propositional::begin(model.clone(), problem)?;
        check_present(&interpreter.tables)?;
        let exact = exact_ticks(&interpreter.tables);
        let sorts = classes(&interpreter.tables)?;
        let slots = Slots::of(&model, &sorts);
        check_counts(&model, &slots)?;
        let table = Table::default();
        Ok(Compiled::start(interpreter, sorts, slots, exact, table))
    }

    fn start(
        mut interpreter: Propositional,
        sorts: Sorts,
        slots: Slots,
        exact: Ticks,
        table: Table,
    ) -> Self {
        interpreter.world.state.exact = exact;
        let model = interpreter.model().clone();
        let timelines = model.timelines.len();
        let registers = Registers {
            cells: vec![None; table.width],
            posted: Vec::new(),
            ends: vec![0; 2 * timelines],
        };
        Compiled {
            model,
            sorts,
            slots,
            exact,
            table,
            state: 0,
            node: None,
            posted: Vec::new(),
            registers,
            pending: NONE,
            spare: Registers::default(),
            lanes: vec![Lane::default(); timelines],
            near: Ticks::MAX,
            now: 0,
            solved: None,
            interpreter: Some(Box::new(interpreter)),
            recent: Recent::Listed,
            listed: NONE,
            started: Vec::new(),
            ended: Vec::new(),
            counters: ServiceCounters::default(),
            base: ServiceCounters::default(),
            interpreted: 0,
        }
    }

    /// From the start again, with the table as it is by now.
    ///
    /// # Errors
    ///
    /// As [`new`](Compiled::new).
    pub fn restarted(self) -> Result<Self, NotCompiled> {
        let interpreter = Propositional::new(self.model)?;
        let (sorts, slots) = (self.sorts, self.slots);
        Ok(Compiled::start(
            interpreter,
            sorts,
            slots,
            self.exact,
            self.table,
        ))
    }

    /// How large the table is by now.
    pub fn size(&self) -> TableSize {
        let (table_bytes, bytes) = self.table.bytes();
        TableSize {
            states: self.table.forms.len(),
            nodes: self.table.nodes.len(),
            transitions: self.table.transitions,
            effects: self.table.effects.len(),
            bytes,
            table_bytes,
            interpreted: self.interpreted,
        }
    }

    /// The interpreter, with what was posted in this cycle.
    fn wake(&mut self) -> &mut Propositional {
        self.settle();
        if self.interpreter.is_none() {
            let mut interpreter = self.table.forms[self.state as usize].interpreter.clone();
            // The form may be of a later tick, of before a restart.
            (interpreter.now, interpreter.world.state.tick) = (self.now, self.now);
            interpreter.posted = 0;
            self.base = interpreter.counters();
            self.fill(&mut interpreter);
            for posted in &self.posted {
                let again = post(&mut interpreter, posted, self.values(posted));
                debug_assert!(again.is_ok(), "it was taken before: {again:?}");
            }
            self.interpreter = Some(interpreter);
        }
        self.interpreter.as_mut().expect("it was made")
    }

    /// The values of something that was posted in this cycle.
    fn values(&self, posted: &Posted) -> &[Option<Value>] {
        &self.registers.posted[posted.first as usize..][..posted.count as usize]
    }

    /// Fills a state's form from its registers.
    fn fill(&self, interpreter: &mut Propositional) {
        let (state, form) = (
            &mut interpreter.world.state,
            &self.table.forms[self.state as usize],
        );
        state.exact = self.exact;
        state.loose.set(false);
        state.formulas.clear();
        for (place, (known, &source)) in (0..).zip(state.cells.iter_mut().zip(&form.cells)) {
            (known.value, known.origin) = (self.cell(source), Origin::Cell(place));
        }
        for (place, (bounds, &held)) in (0..).zip(state.finishes.iter_mut().zip(&form.ends)) {
            let from = |time: Ticks| -> Fars {
                let far = is_far(time, self.now, self.exact);
                far.then_some(Far::End(place)).into_iter().collect()
            };
            let [min, max] = held.map(|held| self.bound(held));
            (bounds.min, bounds.max) = (min, max);
            (bounds.lows, bounds.highs) = (from(min), from(max));
        }
        for (is, lane) in self.lanes.iter().zip(&mut state.lanes) {
            lane.number = is.number;
            if let Some(&token) = lane.tokens.last() {
                state.tokens[usize::from(token)].start = is.start;
            }
        }
    }

    /// Something is posted: along the table, or to the interpreter, which makes a new node.
    #[inline(always)]
    fn post(
        &mut self,
        number: u64,
        (what, predicate): (What, PredicateId),
        values: &[Option<Value>],
    ) -> Result<(), Refusal> {
        self.settle();
        let posted = Posted {
            what,
            predicate,
            first: self.registers.posted.len() as u32,
            count: values.len() as u32,
        };
        match self.child(number) {
            Some(child) if self.interpreter.is_none() => self.node = Some(child),
            _ => self.post_anew(number, &posted, values)?,
        }
        self.posted.push(posted);
        self.registers.posted.extend_from_slice(values);
        Ok(())
    }

    #[inline(never)]
    fn post_anew(
        &mut self,
        number: u64,
        posted: &Posted,
        values: &[Option<Value>],
    ) -> Result<(), Refusal> {
        let interpreter = self.wake();
        // What is refused leaves no trace, and is refused by the interpreter again.
        post(interpreter, posted, values)?;
        let loose = interpreter.world.state.loose.get();
        self.node = match self.node {
            Some(_) if loose => None,
            Some(node) => self.child(number).or_else(|| self.add_node(node, number)),
            None => None,
        };
        Ok(())
    }

    fn add_node(&mut self, parent: u32, number: u64) -> Option<u32> {
        let grows = self.table.nodes.len() < MOST_NODES;
        grows.then(|| self.table.add_child(parent, number))
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

/// Whether what may be posted can be numbered.
fn check_counts(model: &Model, slots: &Slots) -> Result<(), NotCompiled> {
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
    for (predicate, said) in model.predicates.iter().enumerate() {
        for is_goal in [true, false] {
            let counts = slots.given(predicate, is_goal).iter().map(|at| at.count);
            let all = counts.fold(1, u64::saturating_mul);
            let what = format!("classes of what {} says", said.name);
            check(&what, 1 << CLASS_BITS, all)?;
        }
    }
    Ok(())
}

/// Posts something to the interpreter.
fn post(
    interpreter: &mut Propositional,
    posted: &Posted,
    values: &[Option<Value>],
) -> Result<(), Refusal> {
    match posted.what {
        What::Status(contract, ends) => interpreter.bind(contract, values, ends),
        What::Goal(timeline) => {
            let inputs: SmallVec<[Value; 4]> = values.iter().copied().flatten().collect();
            interpreter.insert_goal(timeline, posted.predicate, &inputs)
        }
        What::Cancel(contract) => interpreter.cancel(contract),
    }
}

impl PlanService for Compiled {
    fn model(&self) -> &Arc<Model> {
        &self.model
    }

    fn advance(&mut self, now: Ticks) {
        self.settle();
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
        let known = self.on_table(contract)?;
        let number = match known {
            Some(predicate) => self.number(STATUS, timeline, predicate, ends, outputs)?,
            None => 0,
        };
        let what = What::Status(contract, ends);
        self.post(number, (what, known.unwrap_or(0)), outputs)?;
        self.lanes[timeline].over |= ends;
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
        let number = self.number(GOAL, timeline, predicate, false, &values)?;
        self.post(number, (What::Goal(timeline), predicate), &values)
    }

    fn cancel(&mut self, contract: Contract) -> Result<(), Refusal> {
        // It is the same whatever the token says.
        let timeline = u64::from(contract.timeline);
        self.on_table(contract)?;
        let number = CANCEL << 61 | timeline << 49;
        self.post(number, (What::Cancel(contract), 0), &[])
    }

    fn solve(&mut self, horizon: Ticks, budget: u64) -> Outcome {
        let outcome = self.decide(horizon, budget);
        if let Recent::Row(effect) = self.recent {
            self.list(effect);
        }
        outcome
    }

    fn started(&self) -> &[Started] {
        self.lists().0
    }

    fn ended(&self) -> &[Ended] {
        self.lists().1
    }

    fn present(&self, timeline: TimelineId) -> Option<Present> {
        if let Some(interpreter) = &self.interpreter {
            return interpreter.present(timeline);
        }
        let form = &self.table.forms[self.state as usize];
        let row = &self.table.rows[*form.lanes.get(timeline)? as usize];
        let sources = self.table.sources(row).iter();
        Some(Present {
            contract: Contract {
                timeline: timeline as u16,
                number: self.lanes[timeline].number,
            },
            predicate: usize::from(row.predicate),
            start: self.lanes[timeline].start,
            parameters: sources.map(|&source| self.cell(source)).collect(),
        })
    }

    /// Nothing is left to forget: no more than the present is ever kept.
    fn forget(&mut self, _before: Ticks) {}

    fn counters(&self) -> ServiceCounters {
        ServiceCounters {
            tokens: self.lanes.len() as u64,
            ..self.counters
        }
    }

    fn now(&self) -> Ticks {
        self.now
    }

    fn commit(&mut self, snapshot: &Snapshot, plan: Plan) -> Result<(), Stale> {
        if let Recent::Row(effect) = self.recent {
            // Its registers are filled now.
            self.list(effect);
        }
        self.node = None;
        self.wake().commit(snapshot, plan)
    }

    fn drop_plan(&mut self, timeline: TimelineId) {
        if let Some(interpreter) = &mut self.interpreter {
            interpreter.drop_plan(timeline);
        }
    }
}
