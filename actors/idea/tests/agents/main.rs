//! Agents as actors, in graphs: how long an answer takes, and what holds whatever is lost.

mod alone;
mod graph;
mod mission;
mod ground;
mod plant;
mod response;
mod scenario;
