//! The seams that systems are built on: one module for each, which shows it from outside, through
//! logs and executors as a user meets it.

mod hosts;
mod names;
mod planning;
mod poses;
mod processors;
mod recipients;
mod studies;
mod told;

use farside::{Executor, Report, Simulation};

/// The report of a model, which both executors must agree on.
fn agreed(build: impl Fn() -> Simulation) -> Report {
    let run = |executor| build().run(executor).expect("the model can start");
    let inline = run(Executor::Inline);
    assert_eq!(inline, run(Executor::Kameo { threads: 2 }));
    inline
}
