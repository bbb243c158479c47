//! Planning for a team of rovers: which observations are made, by whom, in which order and when.
//!
//! After sections 3 and 4 of the MISUS paper (T. Estlin, D. Gaines, F. Fisher and R. Castano,
//! "Coordinating Multiple Rovers with Interdependent Science Objectives", AAMAS 2005). Nothing here
//! is an actor or knows a clock or a link: planners are functions of a problem, of what they were told, and
//! of an addressed stream of random numbers. What they do is counted in operations.
//!
//! | module | what it is |
//! |---|---|
//! | [`problem`] | rovers, their sols and resources, goals, combinations; the paper's generator; JSON |
//! | [`instance`] | a problem with names resolved and every drive timed |
//! | [`chain`] | one rover's ordered plan, with slack in time, energy and memory |
//! | [`score`] | Equation 1 over a planner's own goals and those it last heard others hold |
//! | [`casper`] | a rover's planner: iterative repair, and three ways to choose the next goal |
//! | [`central`] | who is assigned which goal, and what becomes of shed ones |
//! | [`objective`] | what counts besides Equation 1 |
//! | [`lns`] | a planner of the whole team by large-neighbourhood search |
//! | [`bounds`] | what plans of known problems are worth at the most |
//! | [`rounds`] | the paper's evaluation: planners synchronised after each step, links perfect |
//! | [`plan`] | a team's plan as data, and whether it is valid: shares no code with the planners |

pub mod bounds;
pub mod casper;
pub mod central;
pub mod chain;
pub mod instance;
pub mod lns;
pub mod objective;
pub mod plan;
pub mod problem;
pub mod rounds;
pub mod score;

#[cfg(test)]
mod tests;
