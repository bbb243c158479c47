//! What systems of actors share, for Farside: links, radios, the fields that rovers drive on and their hardware, processors, units,
//! teams, invariants, figures, what viewers draw with, and what a system is.

pub mod drawing;
pub mod field;
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
