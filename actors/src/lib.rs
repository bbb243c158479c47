//! What systems of actors share, for Farside: links, radios, processors, units, teams, the hardware of
//! rovers, invariants, figures, and what a system is.

pub mod figure;
pub mod invariants;
pub mod link;
pub mod prelude;
pub mod processor;
pub mod radio;
pub mod rover;
pub mod system;
pub mod team;
pub mod units;
pub mod wiring;
