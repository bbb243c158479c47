//! The tests that cross crates, one module for each behaviour.

mod determinism;
mod golden;
mod house;
mod layering;
