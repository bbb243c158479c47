//! Planning on roadmaps in space and time, without messages: the baselines that the network-guided
//! system is held against, centralised, in whole cycles or by what each edge takes ([`Pace`]). They
//! plan one rover after the other with the search that nodes share among them, too:
//! [`safe_intervals`].
//!
//! - [`prioritised`]: the classic scheme (Erdmann and Lozano-Perez 1987; Bennewitz et al. 2002 for
//!   orders), fast, and fails.
//! - [`coupled`](fn@coupled): exact search over all rovers at once (Standley 2010), for a handful of
//!   rovers.
//! - [`lacam`](fn@lacam): search over whole teams' steps, each proposed by priority inheritance
//!   (Okumura 2023), for crowded maps where rovers stay.
//! - [`reference`](fn@reference): revised prioritised planning with safe intervals (Cap, Vokrinek
//!   and Kleiner 2015; Phillips and Likhachev 2011), always succeeds where rovers queue and leave.
//!
//! ```
//! use farside_network::mapf::{Mission, Order, Problem, Rules, reference};
//! use farside_worlds::Roadmap;
//! let map = Roadmap::builtin("crater-dense")?;
//! let rim = map.boundary();
//! let missions = (0..10).map(|i| Mission::new(rim[i % 3], rim[rim.len() - 1 - i])).collect();
//! let problem = Problem::new(&map, missions, Rules::DisappearAtTarget)?;
//! let outcome = reference(&problem, &Order::QueuePosition);
//! assert!(outcome.failures.is_empty());
//! assert_eq!(outcome.plan.conflicts(&problem), []);
//! assert_eq!(outcome.plan.metrics(&problem).arrived, 10);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # The model
//!
//! In time a plan is a list of [visits](safe_intervals). Else time is counted in cycles, from 0;
//! *in cycle t* a rover is at one vertex, and from one cycle to the next it moves along one edge or
//! waits. That is the distributed system's model with the instants at which its cycles begin: what
//! a rover does during a cycle of the simulator lies between two cycles here, so that a lone rover
//! needs as many cycles as its path has edges in both.
//!
//! - Two rovers may not be at one vertex in one cycle, nor swap along an edge.
//! - **Following closely is allowed**: a rover may enter a vertex in the very cycle in which its
//!   occupant leaves it, and so may the next behind it.
//! - **Rotations are forbidden**: three or more rovers on a cycle of the graph may not all move at
//!   once, each into the vertex that the next one leaves. The real system cannot do it: an owner
//!   grants a vertex when its occupant is committed to leaving, so in a rotation each grant
//!   would wait for the one before it, all the way round.
//! - With [`Rules::DisappearAtTarget`] rovers wait in first-in-first-out queues outside their
//!   entries, all present in cycle 0 and occupying nothing. A rover that reaches its goal in cycle
//!   t occupies it in t and is gone in t + 1.
//! - With [`Rules::StayAtTarget`], for grid maps, rovers stand at their entries in cycle 0 and stay
//!   at their goals for ever.

mod check;
mod coupled;
mod joint;
mod lacam;
mod order;
mod plan;
mod prioritised;
mod problem;
mod reference;
pub mod safe_intervals;
mod single;
mod table;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
mod timetable;

pub use check::Conflict;
pub use coupled::{Coupled, CoupledConfig, coupled};
pub use lacam::{Lacam, LacamConfig, lacam};
pub use order::Order;
pub use plan::{Failure, Outcome, Plan, PlanMetrics, Trip};
pub use prioritised::{prioritised, prioritised_in_time};
pub use problem::{CoupledError, Mission, Objective, Problem, ProblemError, Rules};
pub use reference::{reference, reference_in_time};
pub use timetable::{Pace, Timetable, TimetableError};
