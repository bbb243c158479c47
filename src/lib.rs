//! The Farside kernel.

pub mod random;
pub mod time;
