//! Scenarios and the `farside` command.
//!
//! A [`scenario::Scenario`] is a TOML file that says what runs; a
//! [`System`](farside_actors::system::System) reads the part of it that is its own and builds the
//! actors; [`cli::main`] is the command line over both, for the `farside` binary and for binaries
//! with systems of their own.
//!
//! ```
//! use farside::Executor;
//! use farside_experiments::{registry::Registry, scenario::Scenario};
//!
//! let small = ["team.rovers=2".to_owned(), "until=20s".to_owned()];
//! let scenario = Scenario::open("network/crater-dense", &small, &Registry::builtin())?;
//! let assembled = scenario.assemble()?;
//! let report = assembled.sim.run(Executor::Inline)?;
//! let results = (assembled.system.conclude)(&report);
//! assert_eq!(results.metrics["collisions"], 0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod cli;
mod commands;
pub mod export;
mod page;
mod recorded;
pub mod registry;
pub mod report;
pub mod scenario;
mod sequence;
pub mod shrink;
pub mod stats;
pub mod study;
mod thinned;
mod version;
mod wall;
