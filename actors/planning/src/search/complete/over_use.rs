//! What puts an over-used resource right.

use crate::Ticks;
use crate::database::{Database, InstanceId, Owner, TokenId};
use crate::model::{EffectKind, End, ResourceId, ResourceKind};
use crate::profile::{Bound, Contributor, OverUse, critical_sets};
use crate::search::{Decision, Precedence};
use crate::temporal::Span;

/// How many critical sets of an over-use are compared.
const CRITICAL_SETS: usize = 32;

/// What puts an over-use right: two that contribute in order, or one that waits for more.
pub(super) fn over_use_decisions(
    database: &mut Database,
    resource: ResourceId,
    over_use: &OverUse<Owner>,
    into: &mut Vec<Decision>,
) {
    let mut pairs: Vec<(Ticks, Precedence)> = Vec::new();
    let kind = database.model().resources[resource].kind;
    match kind {
        ResourceKind::Renewable | ResourceKind::RateLimited { .. } => {
            let window = match kind {
                ResourceKind::RateLimited { window_ticks } => Some(window_ticks),
                _ => None,
            };
            least_critical(database, window, over_use, &mut pairs);
        }
        ResourceKind::Depletable => {
            others_first(database, resource, over_use, &mut pairs);
        }
    }
    // The pair that leaves most room comes first.
    pairs.sort_by_key(|&(slack, precedence)| (std::cmp::Reverse(slack), precedence));
    let ranked = (0..).zip(&pairs);
    into.extend(ranked.map(|(rank, at)| Decision::Order(at.1, rank)));
    let contributors = over_use.contributors.iter();
    let more = next_change(database, resource, over_use);
    if let Some(until) = more {
        for contributor in contributors {
            if let Some(token) = contributor.owner.master()
                && database.start(token).max >= until
            {
                into.push(Decision::Wait { token, until });
            }
        }
    }
}

/// Other resources for what contributes, where others will do.
pub(super) fn assignments(
    database: &Database,
    resource: ResourceId,
    over_use: &OverUse<Owner>,
    back: bool,
    into: &mut Vec<Decision>,
) {
    for contributor in &over_use.contributors {
        let Owner::Rule { master, rule, .. } = contributor.owner else {
            continue;
        };
        let instances = database.token(master).map_or(&[][..], |at| at.instances());
        let of_rule = |at: &&InstanceId| database.instance(**at).is_some_and(|at| at.rule == rule);
        let Some(&instance) = instances.iter().find(of_rule) else {
            continue;
        };
        for (effect, is_on) in database.assigned(instance) {
            let allowed = &database.model().rules[rule].effects[effect as usize].resources;
            let Some(place) = allowed.iter().position(|&at| at == is_on) else {
                continue;
            };
            let others = allowed.iter().enumerate();
            let others = others.filter(|&(at, _)| at > place || (back && at < place));
            let decisions = others.map(|(_, &resource)| Decision::Assign {
                instance,
                effect,
                resource,
            });
            if is_on == resource {
                into.extend(decisions);
            }
        }
    }
}

/// Of the critical sets the one with the fewest pairs that can be in order: if there is none in
/// one, nothing puts it right.
fn least_critical(
    database: &Database,
    window: Option<Ticks>,
    over_use: &OverUse<Owner>,
    pairs: &mut Vec<(Ticks, Precedence)>,
) {
    let sets = critical_sets(over_use, CRITICAL_SETS);
    let mut best: Option<Vec<(Ticks, Precedence)>> = None;
    for set in sets {
        let members: Vec<&Contributor<Owner>> = set
            .iter()
            .map(|&place| &over_use.contributors[place])
            .collect();
        let mut found = Vec::new();
        for one in &members {
            for other in &members {
                let (Some(first), Some(second)) = (one.owner.master(), other.owner.master()) else {
                    continue;
                };
                if first == second {
                    continue;
                }
                let precedence = match window {
                    None => Precedence {
                        from: (first, End::Finish),
                        to: (second, End::Start),
                        gap: 0,
                    },
                    Some(window) => Precedence {
                        from: (first, End::Start),
                        to: (second, End::Start),
                        gap: window,
                    },
                };
                let slack = precedence.slack(database);
                if slack >= 0 {
                    found.push((slack, precedence));
                }
            }
        }
        if best.as_ref().is_none_or(|best| found.len() < best.len()) {
            best = Some(found);
        }
    }
    pairs.extend(best.into_iter().flatten());
}

/// Tokens whose effects would help come before those that contribute.
fn others_first(
    database: &mut Database,
    resource: ResourceId,
    over_use: &OverUse<Owner>,
    pairs: &mut Vec<(Ticks, Precedence)>,
) {
    let helpers: Vec<(TokenId, End)> = helpers(database, resource, over_use);
    for contributor in &over_use.contributors {
        let Some(second) = contributor.owner.master() else {
            continue;
        };
        for &(first, end) in &helpers {
            if first == second {
                continue;
            }
            let precedence = Precedence {
                from: (first, end),
                to: (second, End::Start),
                gap: 0,
            };
            let slack = precedence.slack(database);
            if slack >= 0 {
                pairs.push((slack, precedence));
            }
        }
    }
}

/// The tokens that change a level the other way, later than it breaks its limit.
fn helpers(
    database: &mut Database,
    resource: ResourceId,
    over_use: &OverUse<Owner>,
) -> Vec<(TokenId, End)> {
    let tick = over_use.worst_tick;
    let helps = |change: Span| match over_use.bound {
        Bound::Least => change.max > 0,
        Bound::Most => change.min < 0,
    };
    let uses = database.levels(resource).earliest.uses();
    let later = uses.filter(|(_, one, _)| helps(one.change) && one.start.min > tick);
    let owners: Vec<Owner> = later.map(|(_, _, owner)| *owner).collect();
    let mut found = Vec::new();
    for owner in owners {
        let Owner::Rule { master, rule, .. } = owner else {
            continue;
        };
        for effect in &database.model().rules[rule].effects {
            let end = match effect.kind {
                EffectKind::Produces(end) | EffectKind::Consumes(end) => end,
                EffectKind::Uses => End::Start,
            };
            if effect.resources.contains(&resource) && !found.contains(&(master, end)) {
                found.push((master, end));
            }
        }
    }
    found
}

/// The next tick at which the problem or the model gives more, after a level broke its limit.
fn next_change(
    database: &Database,
    resource: ResourceId,
    over_use: &OverUse<Owner>,
) -> Option<Ticks> {
    let profile = &database.known_levels(resource).earliest;
    let given = profile
        .uses()
        .filter(|(_, _, owner)| **owner == Owner::Given);
    let helps = given.filter(|(_, one, _)| match over_use.bound {
        Bound::Least => one.change.min > 0,
        Bound::Most => one.change.max < 0,
    });
    let ticks = helps.map(|(_, one, _)| one.start.min);
    ticks.filter(|&tick| tick > over_use.worst_tick).min()
}
