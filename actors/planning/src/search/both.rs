//! The complete planner for a while, then the one that repairs.

use std::sync::Arc;

use super::repair::Repair;
use super::schedule::LoadError;
use super::solve::{Answer, Forward, Planner, Settings};
use crate::model::{Model, Problem};
use crate::plan::Plan;

/// Which share of the operations goes to the complete planner: one of so many.
const SHARE: u64 = 4;

/// [`Forward`] with a quarter of the operations, and if that proves nothing, [`Repair`] with the
/// others. The better one of their plans is the answer: with optional goals the one that is worth
/// more, else the shorter one.
#[derive(Clone, Copy, Debug, Default)]
pub struct Both {
    /// The second of them.
    pub repair: Repair,
}

impl Planner for Both {
    fn name(&self) -> &'static str {
        "both"
    }

    fn solve(
        &self,
        model: &Arc<Model>,
        problem: &Arc<Problem>,
        settings: Settings,
    ) -> Result<Answer, LoadError> {
        let share = Settings {
            operations: settings.operations / SHARE,
            ..settings
        };
        let first = Forward.solve(model, problem, share)?;
        if first.proven {
            return Ok(first);
        }
        let rest = Settings {
            operations: settings.operations.saturating_sub(first.operations),
            ..settings
        };
        let mut second = self.repair.solve(model, problem, rest)?;
        second.operations += first.operations;
        second.counters.decisions += first.counters.decisions;
        second.counters.backtracks += first.counters.backtracks;
        second.counters.refusals += first.counters.refusals;
        let keeps_first = match (&first.plan, &second.plan) {
            (Some(first), Some(second)) => !is_better(second, first),
            (Some(_), None) => true,
            (None, _) => false,
        };
        if keeps_first {
            return Ok(Answer {
                operations: second.operations,
                counters: second.counters,
                ..first
            });
        }
        Ok(second)
    }
}

/// Whether a plan is worth more than another, or is as good and ends earlier.
fn is_better(plan: &Plan, than: &Plan) -> bool {
    match plan.score.total_cmp(&than.score) {
        std::cmp::Ordering::Greater => true,
        std::cmp::Ordering::Equal => plan.makespan < than.makespan,
        std::cmp::Ordering::Less => false,
    }
}
