//! What planners say to each other, and what they record. Goals and rovers are meant by number.

use serde::{Deserialize, Serialize};

use crate::planner::chain::Node;

/// A goal that a rover may plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Assigned {
    /// The goal.
    pub goal: u32,
    /// How many times it had been assigned to any rover, with this time.
    pub assignment: u32,
}

/// A goal in a plan that the centre has made, in the order of the plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Reserved {
    /// The goal.
    pub goal: u32,
    /// In which of the rover's sols.
    pub sol: u32,
}

/// The centre to a rover: all that it may plan now.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct GoalsAssigned {
    /// How often the centre has assigned goals, with this time.
    pub round: u32,
    /// The goals, in ascending order.
    pub goals: Vec<Assigned>,
    /// The plan that the rover begins with, if the centre plans for the team.
    pub plan: Vec<Reserved>,
}

/// A rover to the centre and to the other rovers: how its plan stands.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PlanHeld {
    /// The rover.
    pub rover: u32,
    /// How many optimisation steps it has made.
    pub steps: u32,
    /// The goals that its plan has, in ascending order.
    pub held: Vec<u32>,
    /// What it has shed, as it was assigned, as long as the centre may not know.
    pub shed: Vec<Assigned>,
    /// Whether it waits for the receiver's word on the same step.
    pub asks: bool,
}

/// A timer: an optimisation step begins.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct StepBegins;

/// A timer: the processor is done with a step.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct StepEnds;

/// A timer: what a rover waits for should be there.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct StillWaits {
    /// How many steps it had made when it began to wait.
    pub(super) steps: u32,
}

/// A timer: the centre looks at what it has heard.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct LooksAround;

/// A timer: the processor is done with the centre's assignments.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct AssignmentsLeave;

/// A task of a plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PlannedStop {
    /// A goal, or behind all goals an activity.
    pub task: u32,
    /// In which of the rover's sols.
    pub sol: u32,
    /// When it begins, from the start of the problem \[ms\].
    pub start_ms: i64,
}

impl From<&Node> for PlannedStop {
    fn from(node: &Node) -> PlannedStop {
        PlannedStop {
            task: node.visit.task as u32,
            sol: node.sol as u32,
            start_ms: node.start_ms,
        }
    }
}

/// A state sample: a rover has made an optimisation step.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PlannerStep {
    /// How many it has made, with this one.
    pub steps: u32,
    /// How many iterations it had.
    pub iterations: u32,
    /// What it looked at.
    pub operations: u64,
    /// How many goals it shed.
    pub shed: u32,
    /// How far the plan drives \[mm\].
    pub traverse_mm: u64,
    /// The plan, in order.
    pub plan: Vec<PlannedStop>,
}

/// A state sample: the centre has assigned goals.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CentralRound {
    /// How often it has, with this time.
    pub round: u32,
    /// How many goals went to another rover than before, or were offered again.
    pub reassigned: u32,
    /// What it looked at.
    pub operations: u64,
    /// The goals that it has given up so far.
    pub deleted: Vec<u32>,
}
