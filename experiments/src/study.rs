//! Studies: one question, put to a scenario in many cells and with many seeds.
//!
//! A study file names a scenario, factors, seeds and metrics; each combination of the factors'
//! values is a cell, and each cell runs with the same seeds. What comes of it is [`results`].

pub mod results;
pub mod summary;

#[cfg(test)]
pub(crate) mod fabricated;
