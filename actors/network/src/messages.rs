//! Everything that nodes and rovers of the network-guided system say to each other, and what they
//! record of their state. Plain serde types: the log describes them field by field. Each is
//! declared with the part of the system that it belongs to.

pub use crate::failover::messages::{Account, Content, FailedOver, Inquiry, Passed, Replaced};
pub use crate::failover::rank::Replacement;
pub use crate::ids::RoverId;
pub use crate::max_plus::aids::messages::{Aside, Resolve, WaitProbe, Waiting};
pub use crate::max_plus::messages::{
    Assignment, Assignments, CandidatePaths, Choice, Load, MaxPlus, NodeState, RoverPaths, Vector,
};
pub use crate::node::messages::{Locations, RoadmapKnown};
pub use crate::safety::messages::{
    Beacon, Departed, DepartedAck, Grant, Holding, RoverState, Whereabouts,
};
