//! What systems of actors share, for Farside: links, radios, units, invariants, figures, and what a
//! system is.

pub mod figure;
pub mod invariants;
pub mod link;
pub mod radio;
pub mod system;
pub mod units;
pub mod wiring;
