//! The plan service layer: what an agent's plan runner needs of a planning technology, and no more
//! (section 2 of the IDEA paper: "different planning technologies can be used as long as they can
//! support a standard set of methods").
//!
//! All of it is in tokens: no temporal network, variable or rule is seen from outside. Time is in
//! ticks of the agent's latency. A cycle is [`advance`](PlanService::advance), then any number of
//! [`bind`](PlanService::bind), [`insert_goal`](PlanService::insert_goal) and
//! [`cancel`](PlanService::cancel), then [`solve`](PlanService::solve), then
//! [`forget`](PlanService::forget).

mod check;
pub mod compiled;
pub mod legal;
pub mod propositional;
pub mod temporal;
#[cfg(test)]
mod tests;
mod words;

use std::sync::Arc;

use farside_planning::Ticks;
use farside_planning::model::{Model, PredicateId, TimelineId, Value};
use serde::{Deserialize, Serialize};
use smallvec::SmallVec;
use thiserror::Error;

/// A contract: a token of a timeline, by how many tokens had begun on it before. It is the same under
/// every technology, and never used again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Contract {
    /// The timeline, by its place in the model.
    pub timeline: u16,
    /// How many tokens had begun on it before.
    pub number: u64,
}

/// The values of a token's parameters: the inputs, then the outputs; none where a value is not known.
pub type Parameters = SmallVec<[Option<Value>; 6]>;

/// A token that has begun.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Started {
    /// Which.
    pub contract: Contract,
    /// What it says.
    pub predicate: PredicateId,
    /// Its parameters. The inputs all have values.
    pub parameters: Parameters,
}

/// A token that has ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ended {
    /// Which.
    pub contract: Contract,
    /// What it said.
    pub predicate: PredicateId,
    /// When it began \[ticks\].
    pub start: Ticks,
    /// When it ended \[ticks\].
    pub finish: Ticks,
    /// Its parameters, with the outputs as they were at its end.
    pub parameters: Parameters,
}

/// A token that is there now.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Present {
    /// Which.
    pub contract: Contract,
    /// What it says.
    pub predicate: PredicateId,
    /// Since when \[ticks\].
    pub start: Ticks,
    /// Its parameters, as far as they are known.
    pub parameters: Parameters,
}

/// How a cycle's planning ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Every timeline says something now.
    Decided,
    /// There is nothing that the model allows. Nothing was decided.
    NoPlan(NoPlan),
    /// The budget of operations was spent. Nothing was decided.
    OverBudget,
}

/// Why there is no plan.
#[derive(Clone, Debug, PartialEq, Eq, Error, Serialize, Deserialize)]
#[error("{compatibility}: {reason}")]
pub struct NoPlan {
    /// The compatibility that nothing fulfils: file, line and column, and its master.
    pub compatibility: String,
    /// What was tried, in a sentence.
    pub reason: String,
}

/// Why something that was posted was not taken: nothing changed.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum Refusal {
    /// The contract is not active any more, or never was.
    #[error("contract {number} of {timeline} is not active")]
    Dead {
        /// The timeline's name.
        timeline: String,
        /// Which of its tokens.
        number: u64,
    },
    /// A timeline does not say such a thing.
    #[error("{timeline} does not say {predicate}")]
    Unknown {
        /// The timeline's name.
        timeline: String,
        /// The predicate.
        predicate: String,
    },
    /// A predicate has another number of inputs or outputs.
    #[error("{predicate}: expected {expected} {what}, found {actual}")]
    Count {
        /// The predicate.
        predicate: String,
        /// `inputs` or `outputs`.
        what: &'static str,
        /// How many it has.
        expected: usize,
        /// How many were given.
        actual: usize,
    },
    /// A value is not one of its parameter's type.
    #[error("{predicate}: {parameter}: {value} is not a {expected}")]
    Domain {
        /// The predicate.
        predicate: String,
        /// The parameter.
        parameter: String,
        /// The type.
        expected: String,
        /// The value.
        value: Value,
    },
    /// What the present token and the model's rules allow now forbids it.
    #[error("{what}: {reason}")]
    Rule {
        /// What was posted.
        what: String,
        /// Which rule or time stands against it.
        reason: String,
    },
}

/// All that a cycle was told and all that a technology spent, since its start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ServiceCounters {
    /// Elementary steps of planning: what virtual time is charged for.
    pub operations: u64,
    /// Decisions that were carried out.
    pub decisions: u64,
    /// Decisions that were taken back.
    pub backtracks: u64,
    /// Alternatives whose leading condition did not hold: no backtracks.
    pub guards: u64,
    /// Tokens that are kept now.
    pub tokens: u64,
}

/// What is the case, for those who plan further ahead beside the cycles.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Snapshot {
    /// When it was taken \[ticks\].
    pub tick: Ticks,
    /// By timeline: its present token.
    pub present: Vec<Option<Present>>,
}

/// A plan for one timeline, made beside the cycles: what it says after what it says now, with
/// branches by how each token ends. The reactive planner chooses the branch and starts its token.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plan {
    /// The timeline.
    pub timeline: TimelineId,
    /// Its tokens; the first is the root.
    pub steps: Vec<Step>,
}

/// A token of a plan.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Step {
    /// What it says.
    pub predicate: PredicateId,
    /// Its inputs.
    pub inputs: SmallVec<[Value; 4]>,
    /// It does not start before this tick.
    pub not_before: Ticks,
    /// What follows it: the first whose condition holds; none of them: the default, and the plan is
    /// over.
    pub branches: SmallVec<[Branch; 2]>,
}

/// What follows a token of a plan.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Branch {
    /// An output of the token (by its place among the parameters), and the value that it must have
    /// had at its end; with none, whatever it was.
    pub when: Option<(usize, Value)>,
    /// The token that follows, by its place in [`Plan::steps`]. It is later in the list.
    pub next: usize,
}

/// Why a plan was not taken.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum Stale {
    /// Something has changed since the snapshot.
    #[error("{timeline} says something else than when the snapshot was taken")]
    Changed {
        /// The timeline's name.
        timeline: String,
    },
    /// Something would have to start too soon.
    #[error("step {step} would start at tick {at}, which is not after tick {now}")]
    TooSoon {
        /// Which step of the plan.
        step: usize,
        /// When it would start.
        at: Ticks,
        /// The first tick that is too soon: now and one latency.
        now: Ticks,
    },
    /// It is no plan: a predicate, a value or a branch that cannot be.
    #[error("step {step}: {refusal}")]
    Malformed {
        /// Which step of the plan.
        step: usize,
        /// What is wrong.
        refusal: Refusal,
    },
}

/// A planning technology, as a plan runner sees it.
pub trait PlanService: Send {
    /// The model.
    fn model(&self) -> &Arc<Model>;

    /// It is this tick now. Ticks never fall.
    fn advance(&mut self, now: Ticks);

    /// A status: outputs have values from now on (those that are given; no value changes once it is
    /// known), and with `ends` the token ends as soon as its duration allows.
    ///
    /// # Errors
    ///
    /// If the contract is dead, the values are not of their types, or rules forbid it.
    fn bind(
        &mut self,
        contract: Contract,
        outputs: &[Option<Value>],
        ends: bool,
    ) -> Result<(), Refusal>;

    /// A goal of a controlling system: the timeline says this from now on, in place of what it says.
    ///
    /// # Errors
    ///
    /// If the timeline does not say such things, values are not of their types, or what it says now
    /// may not end.
    fn insert_goal(
        &mut self,
        timeline: TimelineId,
        predicate: PredicateId,
        inputs: &[Value],
    ) -> Result<(), Refusal>;

    /// A controlling system takes a goal back: its token ends now, pre-empted.
    ///
    /// # Errors
    ///
    /// If the contract is dead, or rules forbid it.
    fn cancel(&mut self, contract: Contract) -> Result<(), Refusal>;

    /// Decides what every timeline says, up to `horizon` ticks from now (1: what it says now), with at
    /// most `budget` operations. If it cannot be, nothing was decided, and what was posted in this
    /// cycle still stands.
    fn solve(&mut self, horizon: Ticks, budget: u64) -> Outcome;

    /// The tokens that have begun with the last [`solve`](PlanService::solve), by timeline.
    fn started(&self) -> &[Started];

    /// The tokens that have ended since the last [`solve`](PlanService::solve) but one, by timeline
    /// and time.
    fn ended(&self) -> &[Ended];

    /// What a timeline says now; nothing before the first solution.
    fn present(&self, timeline: TimelineId) -> Option<Present>;

    /// Deletes tokens that ended before a tick, but for the present one of each timeline and the one
    /// before it.
    fn forget(&mut self, before: Ticks);

    /// What was spent.
    fn counters(&self) -> ServiceCounters;

    /// What is the case now.
    fn snapshot(&self) -> Snapshot {
        let timelines = 0..self.model().timelines.len();
        let present: Vec<Option<Present>> = timelines.map(|at| self.present(at)).collect();
        let tick = self.now();
        Snapshot { tick, present }
    }

    /// The tick that it is.
    fn now(&self) -> Ticks;

    /// Takes a plan for a timeline, in place of what was left of the one before, if what the snapshot
    /// says of that timeline is still the case, and nothing of it starts before the tick after the
    /// next one.
    ///
    /// # Errors
    ///
    /// If the snapshot does not fit any more, something would start too soon, or it is no plan.
    fn commit(&mut self, snapshot: &Snapshot, plan: Plan) -> Result<(), Stale>;

    /// Drops what is left of a timeline's plan.
    fn drop_plan(&mut self, timeline: TimelineId);
}
