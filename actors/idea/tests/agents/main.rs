//! Agents as actors, in graphs: how long an answer takes, and what holds whatever is lost.

mod alone;
mod graph;
mod ground;
mod mission;
mod pictures;
mod plant;
mod response;
mod scenario;
