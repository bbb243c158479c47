//! Who plans further ahead than the reactive planner: processes of lower priority, which tokens of a
//! timeline start and stop (section 2 of the IDEA paper: "controlled by the plan runner through goal
//! registers").

use std::sync::{Arc, Mutex};

use farside_planning::model::{PredicateId, TimelineId, Value};

use crate::register::ContractKey;
use crate::service::{Ended, Plan, Snapshot, Started};

/// A deliberative planner that outlives the lives of its agent: what it knows is durable.
pub type SharedDeliberator = Arc<Mutex<dyn Deliberator>>;

/// A deliberative planner.
pub trait Deliberator: Send {
    /// The timeline whose tokens start and stop it.
    fn timeline(&self) -> TimelineId;

    /// Somebody who controls the agent has asked for this, and it begins with this cycle.
    fn asked(&mut self, _predicate: PredicateId, _inputs: &[Value]) {}

    /// A token of any timeline has begun: what there is to plan with may be learnt from it.
    fn begun(&mut self, token: &Started);

    /// A token of any timeline has ended.
    fn ended(&mut self, token: &Ended);

    /// The agent has begun a new life: its timelines say nothing of the one before.
    fn restarted(&mut self) {}

    /// A register whose timeline this is was loaded, in this cycle, with what begins there: it is this
    /// contract of the register, which later lives of the agent may hear of.
    fn loaded(&mut self, _timeline: TimelineId, _contract: ContractKey) {}

    /// The contract that a former life had loaded of which it has to know what has become, and the
    /// timeline of its register: it is asked for until [`Deliberator::late`] tells.
    fn unresolved(&self) -> Option<(TimelineId, ContractKey)> {
        None
    }

    /// How a contract ended that a former life had loaded.
    fn late(&mut self, _timeline: TimelineId, _contract: ContractKey, _end: Late<'_>) {}

    /// The goals that it has given up since it was last asked.
    fn gives_up(&mut self) -> Vec<GivenUp> {
        Vec::new()
    }

    /// The timeline whose plan is not to go on, since something was taken back by what was asked: a
    /// cancel wins over a plan, also over one in the making, and over the step that would begin now.
    fn drops(&mut self) -> Option<TimelineId> {
        None
    }

    /// A token of its own timeline has begun: what comes of the work that it asks for; nothing if it
    /// asks for none. The work is thought to be done later, in the time that cycles leave.
    fn work(&mut self, token: &Started, snapshot: &Snapshot) -> Option<Work>;
}

/// What deliberation came to, and what it took.
#[derive(Clone, Debug)]
pub struct Work {
    /// Elementary steps of planning.
    pub operations: u64,
    /// The outputs of the token that asked for it, if the plan is taken.
    pub outputs: Vec<Option<Value>>,
    /// The plan; none if there is nothing to do, or nothing can be done.
    pub plan: Option<Plan>,
    /// The timelines that it relies on: if one of them says something else when the work is done, the
    /// plan is stale.
    pub reads: Vec<TimelineId>,
    /// What people may want to know: which goals are left out, and why.
    pub remarks: Vec<String>,
}

/// How a contract of a former life ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Late<'a> {
    /// With this first output, by name.
    Ended(&'a str),
    /// The other side could not go on with it.
    Faulted,
    /// It never began, and never will.
    NeverBegun,
}

/// A goal that is not tried any more.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GivenUp {
    /// Its number.
    pub goal: Value,
    /// Why.
    pub reason: String,
}
