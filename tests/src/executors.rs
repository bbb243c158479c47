//! The ways to run a simulation, all of which have to say the same of it.

use farside::{BuildError, Executor, Report, Simulation};

/// The executors, and whether hosts are declared heavy for them: engines on one thread and on several,
/// all hosts in one engine and each in its own.
pub const WAYS: [(Executor, bool); 4] = [
    (Executor::Inline, false),
    (Executor::Kameo { threads: 2 }, false),
    (Executor::Kameo { threads: 1 }, true),
    (Executor::Kameo { threads: 2 }, true),
];

/// Runs what `build` makes, told whether hosts are to be heavy, in all ways; returns what they say.
///
/// # Errors
/// When the simulation cannot start, for the same reason in all ways.
///
/// # Panics
/// When they do not say the same.
pub fn agreed(build: impl Fn(bool) -> Simulation) -> Result<Report, BuildError> {
    let run = |(executor, heavy): (Executor, bool)| build(heavy).run(executor);
    let [first, others @ ..] = WAYS;
    let expected = run(first);
    for way in others {
        assert_eq!(expected, run(way), "{way:?}");
    }
    expected
}
