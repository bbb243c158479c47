//! What science, centre and rovers' planners say to each other besides [`crate::shac`], and what they record of
//! themselves. Times are those of the run; places are metres east and north of the middle of the field.

use farside::SimTime;
use serde::{Deserialize, Serialize};

use crate::analysis::goals::Observation;
use crate::shac::{GoalKey, Party, Reason};

/// From when to when something may be done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Window {
    /// The earliest start.
    pub opens: SimTime,
    /// When it has to have ended.
    pub closes: SimTime,
}

/// An observation that is wished for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ListedGoal {
    /// Its name.
    pub key: GoalKey,
    /// What is done.
    pub observation: Observation,
    /// The rock that is observed, by its number in the catalogue, if it is one.
    pub rock: Option<u32>,
    /// Where the target is thought to be; a panorama is taken there.
    pub position_m: [f64; 2],
    /// What it is worth by itself. May be negative.
    pub weight: f64,
    /// Whether it is planned first, and never shed.
    pub mandatory: bool,
    /// When it may be done; at any time if not given.
    pub window: Option<Window>,
    /// Goals that the same rover has to have achieved before.
    pub requires: Vec<GoalKey>,
    /// The other half, if two rovers have to do it at one time: each half is a goal of the list that is worth
    /// nothing by itself, and both together are a combination.
    pub partner: Option<GoalKey>,
}

/// Goals that change each other's worth.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ListedCombination {
    /// Two different goals of the list or more, in ascending order.
    pub goals: Vec<GoalKey>,
    /// What is added when all are achieved; may be negative.
    pub weight: f64,
}

/// Science to the centre and to all planners: all that is wished for. Of two lists the one with the higher
/// edition holds. It is sent again until its receiver has said that it has it. With elections each site that may have
/// the centre has editions of its own: those that leave its rank among them over when divided by their number.
///
/// Goals that were achieved stay on the list, since combinations with them are still open.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GoalList {
    /// Rises with each change; 0 is before the first list.
    pub edition: u64,
    /// In the order of their names.
    pub goals: Vec<ListedGoal>,
    /// In the order of their goals.
    pub combinations: Vec<ListedCombination>,
}

/// A planner or a centre to science: the list that it has. The answer to every [`GoalList`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct GoalListHeld {
    /// Who has it.
    pub from: Party,
    /// The highest edition that it has.
    pub edition: u64,
}

/// How a rover's planner makes its next plan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PlanMode {
    /// From the plan that it has.
    #[default]
    Continuous,
    /// From nothing.
    Batch,
}

/// Why a rover plans anew.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum ReplanCause {
    /// It has started, or its computer has started again.
    Started,
    /// Goals that it may plan have come or gone.
    Goals,
    /// Weights, combinations or what others hold have changed.
    Worth,
    /// An activity ended earlier than planned.
    Early,
    /// An activity ended, or could begin, later than planned.
    Late,
    /// An activity failed.
    Failed,
    /// The way was blocked.
    Blocked,
    /// There is less energy than planned.
    Power,
    /// There is less memory than planned.
    Memory,
    /// What it knew had changed before the plan was ready.
    Stale,
    /// A new sol has begun.
    Sol,
}

/// What is planned and done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Activity {
    /// A goal, the drive to it not included.
    Goal(GoalKey),
    /// The drive to a goal.
    Drive(GoalKey),
    /// The daily communication of a sol, counted from the start of the run.
    Communication(u32),
    /// Sleep through the night.
    Sleep,
}

/// A goal that a plan should have and has not.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct UnmetGoal {
    /// Which.
    pub goal: GoalKey,
    /// What there is too little of for it.
    pub reason: Reason,
}

/// An activity in a plan.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlannedActivity {
    /// Which.
    pub activity: Activity,
    /// Where the rover is then.
    pub position_m: [f64; 2],
    /// When it begins.
    pub starts: SimTime,
    /// When it has ended.
    pub ends: SimTime,
    /// What the battery is predicted to hold at the end \[J\].
    pub battery_j: f64,
    /// What memory is predicted to hold at the end \[bit\].
    pub memory_bits: i64,
}

/// A state sample: a rover's plan is in force from now on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlanMade {
    /// Counts its plans, from 1.
    pub number: u32,
    /// Why it was made.
    pub cause: ReplanCause,
    /// How.
    pub mode: PlanMode,
    /// The edition of the goal list that it is for.
    pub edition: u64,
    /// What the planner looked at.
    pub operations: u64,
    /// How many of the activities of the plan before that were still ahead are gone or were moved by more
    /// than a minute: the less, the stabler.
    pub moved: u32,
    /// Goals that it had and gave up for want of room or worth.
    pub shed: Vec<GoalKey>,
    /// Mandatory goals that it has and cannot plan, each with what there is too little of.
    pub unmet: Vec<UnmetGoal>,
    /// What the team's goals are worth by this plan and what it last heard of others (Equation 1).
    pub score: f64,
    /// How far it drives \[m\].
    pub traverse_m: f64,
    /// The charge below which no plan goes \[J\].
    pub reserve_j: f64,
    /// What memory holds at the most \[bit\].
    pub memory_size_bits: i64,
    /// What is planned, in order, with what runs first.
    pub activities: Vec<PlannedActivity>,
}

/// A state sample: an activity begins.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ActivityBegan {
    /// The number of the plan that has it.
    pub plan: u32,
    /// As it was planned.
    pub planned: PlannedActivity,
    /// What the battery holds, as last measured \[J\].
    pub battery_j: f64,
    /// What memory holds, as last measured \[bit\].
    pub memory_bits: i64,
}

/// How an activity ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ActivityEnd {
    /// As it was meant to.
    Done,
    /// It was not begun or broken off, and may be tried again.
    Interrupted(Reason),
    /// It failed, and is not tried again.
    Failed(Reason),
}

/// A state sample: an activity has ended.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ActivityEnded {
    /// The number of the plan that had it when it began.
    pub plan: u32,
    /// As it was planned then.
    pub planned: PlannedActivity,
    /// When it began.
    pub began: SimTime,
    /// How it ended.
    pub end: ActivityEnd,
    /// What the battery holds, as last measured \[J\].
    pub battery_j: f64,
    /// What memory holds, as last measured \[bit\].
    pub memory_bits: i64,
}

/// A rover's planner to the others: it is where its half of a goal for two rovers is done, and waits for whoever
/// has the other half.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct HalfReady {
    /// Who waits.
    pub rover: u32,
    /// Its half.
    pub goal: GoalKey,
    /// Whether it has heard that the other one is there, too.
    pub heard: bool,
}

/// The centre to the scientist at its site: the goals that it knows to be achieved, in the order of their names.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GoalsAchieved {
    /// All of them.
    pub goals: Vec<GoalKey>,
}

/// A centre to the scientist at its site, with elections: whether it is the centre now, so that this scientist closes
/// the loop.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OfficeHeld {
    /// Whether it is.
    pub holds: bool,
    /// The goal list that it knows.
    pub list: GoalList,
}

/// A timer: it is time to ask the prioritiser.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct LoopDue;

/// A timer: goals of one's own come, change or go.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct WishesDue;

/// A timer: who has not said that it has the list is told again.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct ListDue;

/// A state sample: the goal list was looked at again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LoopMade {
    /// How often the prioritiser was asked after new readings had come, with this time: the turns of the
    /// closed loop.
    pub loops: u32,
    /// How many readings it knew.
    pub readings: u32,
    /// The edition of the list since then.
    pub edition: u64,
    /// How many goals are new.
    pub added: u32,
    /// How many have another weight or place.
    pub changed: u32,
    /// How many are no longer wished for.
    pub withdrawn: u32,
}

/// A state sample: a centre has shared out open goals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct GoalsShared {
    /// How many goals were open.
    pub open: u32,
    /// How many of them some rover had or was asked for before.
    pub shed: u32,
    /// How many were given to somebody.
    pub given: u32,
    /// What it looked at.
    pub operations: u64,
}
