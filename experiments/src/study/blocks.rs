//! Blocks: seeds that share a problem, as a study file says.

use crate::scenario::{Scenario, ScenarioError};

use super::error::StudyError;
use super::factors::{Blame, FactorPlan};
use super::file::{Seeds, StudyFile};

/// The key of a scenario that blocks set.
const PROBLEM_SEED: &str = "problem_seed";

/// How many seeds a block has: 1 unless the study says.
///
/// # Errors
/// When the seeds, or those after which a cell may stop, are no whole number of blocks; when a
/// factor varies the problem, too.
pub(super) fn block(
    file: &StudyFile,
    factors: &[FactorPlan],
    seeds: usize,
    blame: &Blame<'_>,
) -> Result<usize, StudyError> {
    let block = file.block.unwrap_or(1) as usize;
    if block == 0 {
        let message = "0: expected how many seeds share a problem, 1 or more";
        return Err(blame.invalid("block", message).into());
    }
    if !seeds.is_multiple_of(block) {
        let lower = seeds - seeds % block;
        let fitting = match lower {
            0 => format!("{block}"),
            lower => format!("{lower} or {}", lower + block),
        };
        let own = match (&file.stop, &file.seeds) {
            (Some(stop), _) => stop.max_seeds as usize,
            (None, Some(Seeds::Count(count))) => *count as usize,
            (None, Some(Seeds::List(list))) => list.len(),
            (None, None) => seeds,
        };
        let whole = format!("no whole number of blocks of {block}: {fitting} would be");
        return Err(if own == seeds {
            blame
                .invalid("block", format!("{seeds} seeds are {whole}"))
                .into()
        } else {
            StudyError::Argument(format!("--seeds {seeds}: {whole}"))
        });
    }
    if let Some(stop) = &file.stop
        && !(stop.min_seeds as usize).is_multiple_of(block)
    {
        let found = stop.min_seeds;
        let message = format!("{found} seeds are no whole number of blocks of {block}");
        return Err(blame.invalid("stop.min_seeds", message).into());
    }
    let varies = |plan: &&FactorPlan| plan.keys.iter().any(|key| key == PROBLEM_SEED);
    match factors.iter().find(varies) {
        Some(plan) if block > 1 => {
            let name = &plan.factor.name;
            let message = format!("the factor {name} sets {PROBLEM_SEED}, which blocks set too");
            Err(blame.invalid("block", message).into())
        }
        _ => Ok(block),
    }
}

/// Refuses blocks of problems where the scenario, or what is laid over it, has the one problem.
pub(super) fn check_problem(
    scenario: &Scenario,
    block: usize,
    blame: &Blame<'_>,
) -> Result<(), ScenarioError> {
    match scenario.shared().problem_seed {
        Some(seed) if block > 1 => {
            let message = format!(
                "the scenario has {PROBLEM_SEED} = {seed}, so that all its runs share a problem: \
                 expected either that or blocks"
            );
            Err(blame.invalid("block", message))
        }
        _ => Ok(()),
    }
}
