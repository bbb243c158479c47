//! An order of goals as a plan for the Goal timeline, with a branch for each way in which a goal ends.

use farside_planning::Ticks;
use smallvec::smallvec;

use super::{
    Begin, DeliberationError, Ordering, Settings, Target, Visit, chosen, drive_ticks, order,
};
use crate::models::Mission;
use crate::service::{Branch, Plan, Step};

/// What deliberation came to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Deliberated {
    /// The plan for the Goal timeline; none if no goal is in the order.
    pub plan: Option<Plan>,
    /// The order.
    pub ordering: Ordering,
    /// What all of it took.
    pub operations: u64,
}

/// Orders goals, and makes a plan of it that begins at `h0` or later: after a goal that is done comes
/// the next one; after one that is not, the best order of the others from where the rover was before
/// it. For more goals than [`Settings::few`] that is the rest of the order.
///
/// # Errors
///
/// As those of [`order`].
pub fn deliberate(
    mission: &Mission,
    targets: &[Target],
    begin: &Begin,
    h0: Ticks,
    settings: &Settings,
) -> Result<Deliberated, DeliberationError> {
    let ordering = order(targets, begin, settings)?;
    let mut operations = ordering.operations;
    let count = ordering.visits.len();
    let mut steps: Vec<Step> = Vec::new();
    for visit in &ordering.visits {
        steps.push(step(mission, &targets[visit.target], h0));
    }
    let ok = (image_inputs(mission), mission.statuses.ok);
    for at in 0..count {
        if at + 1 < count {
            let next = at + 1;
            steps[at].branches.push(Branch {
                when: Some(ok),
                next,
            });
        }
        let others = others(&ordering.visits, at, targets.len());
        let other = if targets.len() <= settings.few {
            let (from, spent) = before(&ordering.visits[..at], targets, begin, settings);
            let left: Vec<Target> = others.iter().map(|&target| targets[target]).collect();
            let rest = Settings {
                // It fails when it should have been done, at the worst.
                horizon: (settings.horizon - ordering.visits[at].end).max(1),
                operations: settings.operations.saturating_sub(operations),
                ..*settings
            };
            let begin = Begin {
                battery: from.battery - spent,
                ..from
            };
            let found = chosen(&left, &begin, &rest);
            operations += found.operations;
            found.order.iter().map(|&target| others[target]).collect()
        } else {
            ordering.visits[at + 1..]
                .iter()
                .map(|visit| visit.target)
                .collect::<Vec<usize>>()
        };
        let same = { ordering.visits[at + 1..].iter() }
            .map(|visit| visit.target)
            .eq(other.clone());
        let next = if same && at + 1 < count {
            Some(at + 1)
        } else {
            chain(mission, targets, &other, h0, &mut steps)
        };
        steps[at]
            .branches
            .extend(next.map(|next| Branch { when: None, next }));
    }
    let timeline = mission.timelines.goal;
    let plan = (!steps.is_empty()).then_some(Plan { timeline, steps });
    Ok(Deliberated {
        plan,
        ordering,
        operations,
    })
}

/// The goals that are neither done before a visit nor its own: those that come after it, and those
/// that were left out.
fn others(visits: &[Visit], at: usize, count: usize) -> Vec<usize> {
    let past = |target: &usize| visits[..=at].iter().all(|visit| visit.target != *target);
    (0..count).filter(past).collect()
}

/// Where the rover is after the visits before one, with what the visits and an attempt at the next one
/// have taken from the battery.
fn before(done: &[Visit], targets: &[Target], begin: &Begin, settings: &Settings) -> (Begin, i64) {
    let mut at = [begin.x_dm, begin.y_dm];
    let mut spent = 0;
    for visit in done {
        let target = &targets[visit.target];
        let there = [target.x_dm, target.y_dm];
        spent += settings.drive_energy * drive_ticks(at, there, settings) + settings.image_energy;
        at = there;
    }
    let [x_dm, y_dm] = at;
    (
        Begin {
            x_dm,
            y_dm,
            ..*begin
        },
        spent,
    )
}

/// Adds goals one after the other, however each ends: the place of the first.
fn chain(
    mission: &Mission,
    targets: &[Target],
    order: &[usize],
    h0: Ticks,
    steps: &mut Vec<Step>,
) -> Option<usize> {
    let first = steps.len();
    for (place, &target) in order.iter().enumerate() {
        let mut one = step(mission, &targets[target], h0);
        if place + 1 < order.len() {
            let next = first + place + 1;
            one.branches.push(Branch { when: None, next });
        }
        steps.push(one);
    }
    (!order.is_empty()).then_some(first)
}

fn step(mission: &Mission, target: &Target, not_before: Ticks) -> Step {
    let Target {
        x_dm,
        y_dm,
        pan_deg,
        tilt_deg,
        camera,
        ..
    } = *target;
    Step {
        predicate: mission.predicates.image_at,
        inputs: [x_dm, y_dm, pan_deg, tilt_deg, camera]
            .into_iter()
            .collect(),
        not_before,
        branches: smallvec![],
    }
}

/// The place of a goal's status among its parameters.
fn image_inputs(mission: &Mission) -> usize {
    mission.model.predicates[mission.predicates.image_at].inputs
}
