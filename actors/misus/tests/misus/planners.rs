//! The planners as actors: they plan what they plan without a network, links cost no goal, and what cannot be
//! is said by key.

mod exported;
mod gaps;
mod joint;
mod links;
mod refusals;
mod scenario;
mod synchronised;
