//! Agents as actors, in graphs: how long an answer takes, and what holds whatever is lost.

mod alarms;
mod alone;
mod faulty;
mod graph;
mod ground;
mod mission;
mod mistakes;
mod pictures;
mod plant;
mod relay;
mod remote;
mod response;
mod scenario;
