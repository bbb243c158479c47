//! What agents record of themselves: samples in the log, which metrics and pictures are made of.

use serde::{Deserialize, Serialize};

/// A cycle of a plan runner.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AgentCycle {
    /// k: the cycle began at k times the agent's latency.
    pub tick: u64,
    /// What it took \[operations\].
    pub operations: u64,
    /// What that took on the host's processor \[ns\]: decisions left so long after the tick.
    pub cost_ns: u64,
    /// Decisions of the planner.
    pub decisions: u32,
    /// Decisions that it took back.
    pub backtracks: u32,
    /// Tokens in the plan database afterwards.
    pub tokens: u32,
    /// Goals that were taken.
    pub goals: u32,
    /// Statuses of contracts that were over.
    pub stale: u32,
    /// How long the first of the news that the cycle has answered had waited when the answer left
    /// \[ns\]; 0 if there was none.
    pub response_ns: u64,
    /// What deliberation took in the rest of the latency \[operations\].
    pub deliberation: u64,
    /// Whether it was aborted, since it would have taken too many operations.
    pub aborted: bool,
}

/// A timeline says something else than before.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TimelineSays {
    /// The timeline.
    pub timeline: String,
    /// What it says, as `Stopping(tilt 0)`.
    pub says: String,
    /// The outputs of what it said before, as far as they became known.
    pub before: Vec<String>,
}

impl TimelineSays {
    /// Whether the timeline of the motion's health in the K9's models says that something is wrong.
    pub fn is_alarm(&self) -> bool {
        let is_one = self.says.ends_with("Alarm") || self.says == "HardLimit";
        self.timeline == "MotionHealth_SV" && is_one
    }
}

/// A contract that somebody else had asked for has ended.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct GoalEnded {
    /// The register.
    pub register: String,
    /// The procedure with its inputs, as `ImageAt(120 -35 10 0 hawk_eye)`.
    pub goal: String,
    /// Its outputs, `?` where one is not known.
    pub outputs: Vec<String>,
}

/// An agent does not try a goal any more.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct GoalGivenUp {
    /// Its number.
    pub goal: i64,
    /// Why.
    pub reason: String,
}

/// An agent is faulty: it takes no part any more.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct AgentFaulty {
    /// The tick at which it found out.
    pub tick: u64,
    /// Why.
    pub reason: String,
}

/// Something that an agent cannot use or that went wrong, and that it lives with; or what its
/// deliberation has to say.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct AgentRemark {
    /// The tick.
    pub tick: u64,
    /// A sentence.
    pub text: String,
}
