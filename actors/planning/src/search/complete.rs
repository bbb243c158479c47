//! A complete search of plans: every flaw with all decisions that may put it right.
//!
//! Resources are looked at as they are at the earliest times, which satisfy all constraints. Where
//! a level breaks a limit, some pair of what contributes must be in order (precedence constraint
//! posting, as in A. Cesta, A. Oddi and S. F. Smith, *A Constraint-Based Method for Project
//! Scheduling with Time Windows*, 2002), or something must wait for what the problem gives. Each
//! decision excludes those that were tried before it, so that no schedule is looked for twice.

use std::sync::Arc;

use super::schedule::Schedule;
use super::{Decision, Flaw, Precedence, Strategy};
use crate::Ticks;
use crate::database::{
    Cause, Conflict, Database, InstanceId, Open, Owner, Slot, Status, Step, Time, TokenId, Wanted,
};
use crate::model::{
    EffectKind, End, GoalId, Pattern, Problem, ResourceId, ResourceKind, SlotOrder, Target,
    TimelineId, TimelineKind,
};
use crate::parameters::{Kind, Operand};
use crate::profile::{Bound, Contributor, OverUse, critical_sets};
use crate::temporal::{Constraint, Span};

/// How many critical sets of an over-use are compared.
const CRITICAL_SETS: usize = 32;

/// How many values of a parameter are tried.
const VALUES: usize = 64;

/// All flaws of a schedule, with all their decisions.
#[derive(Clone, Debug)]
pub struct Complete {
    problem: Arc<Problem>,
    goals: Vec<TokenId>,
    /// By goal: whether the plan must have it.
    wanted: Vec<bool>,
    /// How many decisions were numbered: each is an owner of its own.
    decisions: u32,
    /// Whether an effect may go back to a resource that it was on: a search that takes decisions
    /// back in turn must not, or it would not end.
    pub(super) assigns_back: bool,
}

impl Complete {
    /// For a schedule, with its mandatory goals.
    pub fn new(schedule: &Schedule) -> Self {
        let goals = schedule.problem.goals.iter();
        Complete {
            problem: schedule.problem.clone(),
            goals: schedule.goals.clone(),
            wanted: goals.map(|goal| goal.weight.is_none()).collect(),
            decisions: 0,
            assigns_back: false,
        }
    }

    /// Says whether the plan must have a goal.
    pub fn want(&mut self, goal: GoalId, wanted: bool) {
        self.wanted[goal] = wanted;
    }

    /// Whether the plan must have a goal.
    pub fn wants(&self, goal: GoalId) -> bool {
        self.wanted[goal]
    }

    /// The problem.
    pub fn problem(&self) -> &Arc<Problem> {
        &self.problem
    }

    /// By goal: its token.
    pub fn goals(&self) -> &[TokenId] {
        &self.goals
    }

    /// How many decisions were numbered.
    pub(crate) fn numbered(&self) -> u32 {
        self.decisions
    }

    /// An owner for a new decision.
    pub(super) fn owner(&mut self) -> Owner {
        self.decisions += 1;
        Owner::Decision(self.decisions)
    }
}

/// What rules ask for, by the order of the model's search control, then as it was asked for.
pub(super) fn first_open(database: &Database) -> Option<Open> {
    let subgoals = &database.model().control.subgoals;
    let rank = |open: &Open| -> Option<usize> {
        let Step::Relation(at) = open.step else {
            return Some(0);
        };
        let relation = database.relation(open.instance, at);
        let instance = database.instance(open.instance)?;
        // Without its anchor a relation says nothing of times yet.
        instance.label(relation.anchor)?;
        match &relation.target {
            Target::Label(label) => instance.label(*label).map(|_| 0),
            Target::New(pattern, _) => {
                let named = |at: &(TimelineId, usize)| {
                    pattern.timelines.contains(&at.0) && at.1 == pattern.predicate
                };
                let place = subgoals.iter().position(named);
                Some(1 + place.unwrap_or(subgoals.len()))
            }
        }
    };
    let ranked = database
        .open()
        .iter()
        .filter_map(|open| Some((rank(open)?, open)));
    // The first of the least.
    ranked.min_by_key(|at| at.0).map(|at| *at.1)
}

/// The first place on a timeline of states where two tokens do not meet.
pub(super) fn first_gap(database: &Database) -> Option<Flaw> {
    let horizon = database.horizon();
    for (timeline, at) in database.model().timelines.iter().enumerate() {
        if at.kind != TimelineKind::State {
            continue;
        }
        let gap = |after| Some(Flaw::Gap { timeline, after });
        let mut last = None;
        for token in database.on(timeline) {
            let meets = match last {
                None => database.start(token).max <= horizon.min,
                Some(last) => database.meets(last, token),
            };
            if !meets {
                return gap(last);
            }
            last = Some(token);
        }
        let ends = last.is_some_and(|last| database.finish(last).min >= horizon.max);
        if !ends && horizon.min < horizon.max {
            return gap(last);
        }
    }
    None
}

/// The first over-use at the earliest times, of any resource.
pub(super) fn first_over_use(database: &mut Database) -> Option<(ResourceId, OverUse<Owner>)> {
    let mut first: Option<(ResourceId, OverUse<Owner>)> = None;
    for resource in 0..database.model().resources.len() {
        let over_use = database
            .levels(resource)
            .earliest
            .first_over_use(Ticks::MIN);
        if let Some(over_use) = over_use
            && first
                .as_ref()
                .is_none_or(|(_, at)| over_use.worst_tick < at.worst_tick)
        {
            first = Some((resource, over_use));
        }
    }
    first
}

/// The first parameter of an active token that must have a value and has none.
pub(super) fn first_unbound(database: &Database) -> Option<Flaw> {
    let model = database.model();
    let active = database.tokens().filter(|at| at.1.status == Status::Active);
    for (token, at) in active {
        let inputs = model.predicates[at.predicate].inputs;
        for (parameter, &operand) in at.parameters.iter().enumerate().take(inputs) {
            let left = model.control.unbound.contains(&(at.predicate, parameter));
            if !left && database.value(operand).is_none() {
                return Some(Flaw::Unbound { token, parameter });
            }
        }
    }
    None
}

impl Strategy for Complete {
    fn next(&mut self, database: &mut Database) -> Option<Flaw> {
        if let Some(open) = first_open(database) {
            return Some(Flaw::Open(open));
        }
        let missing =
            |goal: &GoalId| self.wanted[*goal] && !Schedule::is_in(database, self.goals[*goal]);
        if let Some(goal) = (0..self.goals.len()).find(missing) {
            return Some(Flaw::Goal(self.goals[goal]));
        }
        if let Some((resource, over_use)) = first_over_use(database) {
            return Some(Flaw::OverUse {
                resource,
                bound: over_use.bound,
                tick: over_use.worst_tick,
            });
        }
        first_unbound(database).or_else(|| first_gap(database))
    }

    fn decisions(&mut self, database: &mut Database, flaw: Flaw, into: &mut Vec<Decision>) {
        match flaw {
            Flaw::Open(Open { instance, step }) => open_decisions(database, instance, step, into),
            Flaw::Goal(token) => self.goal_decisions(database, token, into),
            Flaw::OverUse {
                resource, bound, ..
            } => {
                let levels = database.levels(resource);
                if let Some(over_use) = levels.earliest.first_over_use_of(bound, Ticks::MIN) {
                    over_use_decisions(database, resource, &over_use, into);
                    let back = self.assigns_back;
                    assignments(database, resource, &over_use, back, into);
                }
            }
            Flaw::Unbound { token, parameter } => {
                let operand = database.token(token).map(|at| at.parameters[parameter]);
                if let Some(Operand::Variable(variable)) = operand {
                    let values = database.store().domain(variable).values();
                    into.extend(values.take(VALUES).map(Decision::Bind));
                }
            }
            Flaw::Gap { timeline, after } => gap_decisions(database, timeline, after, into),
        }
    }

    fn decide(
        &mut self,
        database: &mut Database,
        flaw: Flaw,
        decision: Decision,
    ) -> Result<(), Conflict> {
        if let Decision::Order(precedence, rank) = decision {
            let mut all = Vec::new();
            if rank > 0 {
                self.decisions(database, flaw, &mut all);
            }
            return database.attempt(|database| {
                for before in all.into_iter().take(rank as usize) {
                    if let Decision::Order(before, _) = before {
                        let owner = self.owner();
                        precede(database, before, false, owner)?;
                    }
                }
                let owner = self.owner();
                precede(database, precedence, true, owner)?;
                Ok(())
            });
        }
        self.carry_out(database, flaw, decision).map(|_| ())
    }
}

/// An order that was posted for a token, and whose it is.
pub(super) type Posted = (Option<(TokenId, Constraint)>, Owner);

impl Complete {
    /// Carries out a decision that excludes no other: what it posted, if that can be taken back.
    pub(super) fn carry_out(
        &mut self,
        database: &mut Database,
        flaw: Flaw,
        decision: Decision,
    ) -> Result<Posted, Conflict> {
        let owner = self.owner();
        let posted = match (flaw, decision) {
            (_, Decision::Order(precedence, _)) => precede(database, precedence, true, owner)?,
            (_, Decision::Wait { token, until }) => {
                let times = [Time::At(0), database.time(token, End::Start)];
                database.order_for(token, times, Span::at_least(until), owner)?
            }
            (Flaw::Gap { timeline, after }, Decision::Close) => {
                close(database, timeline, after, owner)?
            }
            _ => {
                self.put_right(database, flaw, decision, owner)?;
                None
            }
        };
        Ok((posted, owner))
    }

    /// Carries out a decision about tokens and values.
    fn put_right(
        &mut self,
        database: &mut Database,
        flaw: Flaw,
        decision: Decision,
        owner: Owner,
    ) -> Result<(), Conflict> {
        match (flaw, decision) {
            (
                _,
                Decision::Assign {
                    instance,
                    effect,
                    resource,
                },
            ) => database.assign(instance, effect, resource),
            (Flaw::Unbound { token, parameter }, Decision::Bind(value)) => {
                database.bind(token, parameter, value, owner)
            }
            (Flaw::Open(Open { instance, step }), decision) => match (step, decision) {
                (Step::Choice(choice), Decision::Alternative(alternative)) => {
                    database.choose(instance, choice, alternative);
                    Ok(())
                }
                (Step::Relation(relation), Decision::Support(token)) => {
                    database.support(instance, relation, token)
                }
                (Step::Relation(relation), Decision::Insert(slot)) => database
                    .insert_for(instance, relation, slot, None)
                    .map(|_| ()),
                (Step::Relation(relation), Decision::Displace { slot, token }) => {
                    database.attempt(|database| {
                        make_room(database, slot, token)?;
                        // Whoever asks may have gone with it.
                        if !database.open().contains(&Open { instance, step }) {
                            let owner = Owner::Token(token);
                            return Err(Conflict::Mismatch { owner });
                        }
                        database.insert_for(instance, relation, slot, None)?;
                        Ok(())
                    })
                }
                (Step::Relation(relation), Decision::Relate) => {
                    database.relate_labels(instance, relation)
                }
                _ => unreachable!("{decision:?} is no decision for {flaw:?}"),
            },
            (Flaw::Goal(token), decision) => self.put_goal(database, token, decision),
            (Flaw::Gap { after, .. }, Decision::Insert(slot)) => fill(database, slot, after, owner),
            _ => unreachable!("{decision:?} is no decision for {flaw:?}"),
        }
    }

    fn put_goal(
        &mut self,
        database: &mut Database,
        token: TokenId,
        decision: Decision,
    ) -> Result<(), Conflict> {
        let goal = self.goals.iter().position(|&at| at == token);
        let goal = goal.expect("the token is a goal's");
        let (problem, goals) = (&self.problem, &self.goals);
        match decision {
            Decision::Insert(slot) => Schedule::activate_goal(problem, goals, database, goal, slot),
            Decision::Displace { slot, token } => database.attempt(|database| {
                make_room(database, slot, token)?;
                Schedule::activate_goal(problem, goals, database, goal, slot)
            }),
            Decision::Support(into) => Schedule::merge_goal(problem, goals, database, goal, into),
            _ => unreachable!("{decision:?} is no decision for a goal"),
        }
    }

    fn goal_decisions(&self, database: &Database, token: TokenId, into: &mut Vec<Decision>) {
        let goal = self.goals.iter().position(|&at| at == token);
        let goal = goal.expect("the token is a goal's");
        let pattern = &self.problem.goals[goal].pattern;
        for &timeline in &pattern.timelines {
            if database.model().timelines[timeline].kind != TimelineKind::Free {
                let same = database
                    .on(timeline)
                    .filter(|&at| same_kind(database, token, at));
                into.extend(same.map(Decision::Support));
            }
        }
        let window = [database.start(token), database.finish(token)];
        slots(database, pattern, window, None, into);
    }
}

/// Whether a token can be merged into another, as far as each parameter alone says.
fn same_kind(database: &Database, token: TokenId, other: TokenId) -> bool {
    let (Some(token), Some(other)) = (database.token(token), database.token(other)) else {
        return false;
    };
    token.predicate == other.predicate
        && token
            .parameters
            .iter()
            .zip(&other.parameters)
            .all(|(one, other)| {
                one == other
                    || database.store().entailed(&Kind::Equal, &[*one, *other]) != Some(false)
            })
}

/// All that may put right what an instance asks for.
fn open_decisions(database: &Database, instance: InstanceId, step: Step, into: &mut Vec<Decision>) {
    let relation = match step {
        Step::Choice(choice) => {
            let alternatives = database.alternatives(instance, choice).len() as u32;
            into.extend((0..alternatives).map(Decision::Alternative));
            return;
        }
        Step::Relation(relation) => relation,
    };
    let said = database.relation(instance, relation);
    let Target::New(pattern, _) = &said.target else {
        into.push(Decision::Relate);
        return;
    };
    let Some(anchor) = database
        .instance(instance)
        .and_then(|at| at.label(said.anchor))
    else {
        return;
    };
    let mut window = [Span::ALL; 2];
    for distance in &said.distances {
        let from = database.bounds_of(database.time(anchor, distance.from));
        let span = database.span(instance, distance.min, distance.max, distance.backward);
        let place = usize::from(distance.to == End::Finish);
        let add = |time: Ticks, by: Ticks| match by {
            Ticks::MIN | Ticks::MAX => by,
            by => time.saturating_add(by),
        };
        let at = Span::new(add(from.min, span.min), add(from.max, span.max));
        window[place] = window[place].intersect(at);
    }
    for &timeline in &pattern.timelines {
        for token in database.on(timeline) {
            let within = !database.start(token).intersect(window[0]).is_empty()
                && !database.finish(token).intersect(window[1]).is_empty();
            if within && token != anchor && database.fits(instance, relation, token) {
                into.push(Decision::Support(token));
            }
        }
    }
    if !said.condition {
        let near = Some(database.start(anchor).min);
        slots(database, pattern, window, near, into);
    }
}

/// The places where a token can be that starts and ends within a window, in the order that the
/// model's search control says; then those where something that only rules asked for makes room.
fn slots(
    database: &Database,
    pattern: &Pattern,
    [start, finish]: [Span; 2],
    near: Option<Ticks>,
    into: &mut Vec<Decision>,
) {
    let first = into.len();
    let mut displacing = Vec::new();
    for &timeline in &pattern.timelines {
        if database.model().timelines[timeline].kind == TimelineKind::Free {
            let after = database.last(timeline);
            into.push(Decision::Insert(Slot { timeline, after }));
            continue;
        }
        let from = into.len();
        let mut after = None;
        loop {
            let next = match after {
                None => database.first(timeline),
                Some(token) => database.token(token).and_then(|at| at.after()),
            };
            let bounds = |after: Option<TokenId>, next: Option<TokenId>| {
                let begins = after.map_or(Ticks::MIN, |at| database.finish(at).min);
                let ends = next.map_or(Ticks::MAX, |at| database.start(at).max);
                begins < ends && begins <= start.max && finish.min <= ends && start.min < ends
            };
            let slot = Slot { timeline, after };
            if bounds(after, next) {
                into.push(Decision::Insert(slot));
            }
            let Some(next) = next else { break };
            let beyond = database.token(next).and_then(|at| at.after());
            if is_removable(database, next) && bounds(after, beyond) {
                let token = next;
                displacing.push(Decision::Displace { slot, token });
            }
            after = Some(next);
        }
        order_slots(database, timeline, pattern, near, &mut into[from..]);
    }
    debug_assert!(first <= into.len(), "decisions were added");
    into.extend(displacing);
}

/// Whether only rules or gaps asked for a token, so that it can make room.
fn is_removable(database: &Database, token: TokenId) -> bool {
    let cause = database.token(token).map(|at| at.cause);
    matches!(cause, Some(Cause::Rule { .. } | Cause::Filler))
}

fn order_slots(
    database: &Database,
    timeline: TimelineId,
    pattern: &Pattern,
    near: Option<Ticks>,
    slots: &mut [Decision],
) {
    let rules = database.model().control.slots.iter();
    let mut said = rules.filter(|at| (at.0, at.1) == (timeline, pattern.predicate));
    match said.next().map_or(SlotOrder::Earliest, |at| at.2) {
        SlotOrder::Earliest => {}
        SlotOrder::Latest => slots.reverse(),
        SlotOrder::Nearest => slots.sort_by_key(|slot| match slot {
            Decision::Insert(Slot { after, .. }) => {
                let begins = after.map_or(0, |at| database.finish(at).min);
                begins.abs_diff(near.unwrap_or(0))
            }
            _ => u64::MAX,
        }),
    }
}

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
fn assignments(
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

/// Two tokens of states meet, or one more is put between them.
fn gap_decisions(
    database: &Database,
    timeline: TimelineId,
    after: Option<TokenId>,
    into: &mut Vec<Decision>,
) {
    let next = match after {
        None => database.first(timeline),
        Some(after) => database.token(after).and_then(|at| at.after()),
    };
    if after.is_some() || next.is_some() {
        into.push(Decision::Close);
    }
    if database.model().timelines[timeline].default.is_some() {
        into.push(Decision::Insert(Slot { timeline, after }));
    }
}

/// Two tokens meet; the first one starts with the horizon, the last one ends with it.
fn close(
    database: &mut Database,
    timeline: TimelineId,
    after: Option<TokenId>,
    owner: Owner,
) -> Result<Option<(TokenId, Constraint)>, Conflict> {
    let horizon = database.horizon();
    let next = match after {
        None => database.first(timeline),
        Some(after) => database.token(after).and_then(|at| at.after()),
    };
    let (token, times, span) = match (after, next) {
        (None, Some(first)) => {
            let times = [Time::At(0), database.time(first, End::Start)];
            (first, times, Span::exactly(horizon.min))
        }
        (Some(last), None) => {
            let times = [Time::At(0), database.time(last, End::Finish)];
            (last, times, Span::exactly(horizon.max))
        }
        (Some(first), Some(second)) => {
            let times = [
                database.time(first, End::Finish),
                database.time(second, End::Start),
            ];
            (second, times, Span::exactly(0))
        }
        (None, None) => return Ok(None),
    };
    database.order_for(token, times, span, owner)
}

/// A timeline says its default after a token, from that token's end on.
fn fill(
    database: &mut Database,
    slot: Slot,
    after: Option<TokenId>,
    owner: Owner,
) -> Result<(), Conflict> {
    let model = database.model().clone();
    let Some(default) = &model.timelines[slot.timeline].default else {
        let owner = after.map_or(Owner::Given, Owner::Token);
        return Err(Conflict::Mismatch { owner });
    };
    let values = default.values.iter().map(|value| value.map(Operand::Value));
    let parameters: smallvec::SmallVec<[Option<Operand>; 4]> = values.collect();
    database.attempt(|database| {
        let token = database.insert(Wanted {
            predicate: default.predicate,
            timeline: Some(slot.timeline),
            parameters: &parameters,
            start: None,
            finish: None,
            cause: Cause::Filler,
        })?;
        database.activate(token, slot)?;
        close(database, slot.timeline, after, owner)?;
        Ok(())
    })
}

/// Removes a token, so that there is room where it was; not if the slot goes with it.
fn make_room(database: &mut Database, slot: Slot, token: TokenId) -> Result<(), Conflict> {
    database.remove(token);
    let stays = |after| {
        database
            .token(after)
            .is_some_and(|at| at.status == Status::Active)
    };
    if slot.after.is_none_or(stays) {
        return Ok(());
    }
    let owner = Owner::Token(token);
    Err(Conflict::Mismatch { owner })
}

/// Posts a precedence, or its contrary.
pub(super) fn precede(
    database: &mut Database,
    precedence: Precedence,
    holds: bool,
    owner: Owner,
) -> Result<Option<(TokenId, Constraint)>, Conflict> {
    let Precedence { from, to, gap } = precedence;
    let span = if holds {
        Span::at_least(gap)
    } else {
        Span::at_most(gap - 1)
    };
    let times = [from, to].map(|(token, end)| database.time(token, end));
    database.order_for(to.0, times, span, owner)
}
