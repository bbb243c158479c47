//! The tests that cross crates, one module for each behaviour.

mod determinism;
