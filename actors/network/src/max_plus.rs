//! The algorithm of the policy `max-plus`, without messages between actors: the local neighbourhood
//! graph, candidate paths, payoffs, max-plus itself, and how long a processor takes for it. What
//! nodes do with it is in `node::max_plus`.

pub(crate) mod aids;
pub(crate) mod assignment;
pub(crate) mod candidates;
pub(crate) mod config;
pub(crate) mod lng;
pub(crate) mod loads;
pub(crate) mod messages;
pub(crate) mod payoff;
pub(crate) mod processor;
pub(crate) mod solver;
