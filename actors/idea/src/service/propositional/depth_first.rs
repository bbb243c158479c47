//! Depth first, with copies: the last decision that has an alternative is taken back first.

use super::search::{Decisions, Failure, Flaw, World};
use super::state::Clash;
use super::{Propositional, Tables, rules};
use crate::service::{NoPlan, PlanService, words};

/// A flaw whose decisions are being tried.
struct Frame {
    flaw: Flaw,
    /// What was known before its first decision, if it has several.
    before: Option<World>,
    untried: Decisions,
}

/// Whether a flaw that nothing puts right was asked to see whether the decision before it is one.
fn is_guard(tables: &Tables, world: &World, before: Flaw, failed: Flaw) -> bool {
    let (Flaw::Open(before), Flaw::Open(failed)) = (before, failed) else {
        return false;
    };
    let (rules::Part::Choice(_), rules::Part::Relation(relation)) = (before.part, failed.part)
    else {
        return false;
    };
    (before.token, before.instance) == (failed.token, failed.instance)
        && tables.flats[world.rule(failed)].relations[usize::from(relation)].condition
}

impl Propositional {
    /// Puts flaws right until there are none, with at most so many operations.
    pub(super) fn search(
        &mut self,
        world: &mut World,
        budget: u64,
    ) -> Result<(), Option<Box<Failure>>> {
        let limit = self.world.state.operations.saturating_add(budget);
        let tables = self.tables.clone();
        let mut frames: Vec<Frame> = Vec::new();
        let mut deepest: (usize, Option<Box<Failure>>) = (0, None);
        loop {
            if world.state.operations > limit {
                return Err(None);
            }
            world.state.operations += world.state.open.len() as u64;
            let Some(flaw) = world.flaw(&tables, self.now) else {
                return Ok(());
            };
            let (mut untried, guards) = world.decisions(&tables, self.now, flaw);
            self.counters.guards += guards;
            untried.reverse();
            let before = (untried.len() > 1).then(|| world.clone());
            frames.push(Frame {
                flaw,
                before,
                untried,
            });
            if !self.go_on(world, &mut frames, &mut deepest, limit) {
                let spent = world.state.operations > limit;
                return Err(deepest.1.filter(|_| !spent));
            }
        }
    }

    /// Carries out the best decision of the last flaw that can be; whether there is one.
    fn go_on(
        &mut self,
        world: &mut World,
        frames: &mut Vec<Frame>,
        deepest: &mut (usize, Option<Box<Failure>>),
        limit: u64,
    ) -> bool {
        let tables = self.tables.clone();
        let mut clashes: Vec<Clash> = Vec::new();
        let (mut fresh, mut first) = (true, true);
        while let Some(frame) = frames.last_mut() {
            if world.state.operations > limit {
                return false;
            }
            if let Some(before) = frame.before.as_ref().filter(|_| !first) {
                let operations = world.state.operations;
                let loose = world.state.loose.get();
                *world = before.clone();
                world.state.loose.set(loose);
                world.state.operations = operations + world.state.tokens.len() as u64;
            }
            first = false;
            let flaw = frame.flaw;
            if let Some(decision) = frame.untried.pop() {
                let decided = world.decide(&tables, self.now, flaw, decision);
                match decided.and_then(|()| world.state.settle(&tables)) {
                    Ok(()) => {
                        self.counters.decisions += 1;
                        return true;
                    }
                    Err(clash) if fresh => clashes.push(clash),
                    Err(_) => {}
                }
                continue;
            }
            let depth = frames.len();
            if fresh && (deepest.1.is_none() || depth > deepest.0) {
                *deepest = (
                    depth,
                    Some(self.failure(world, flaw, std::mem::take(&mut clashes))),
                );
            }
            fresh = false;
            frames.pop();
            if let Some(before) = frames.last() {
                let is_guard = is_guard(&tables, world, before.flaw, flaw);
                let taken_back = if is_guard {
                    &mut self.counters.guards
                } else {
                    &mut self.counters.backtracks
                };
                *taken_back += 1;
            }
        }
        false
    }

    pub(super) fn failure(&self, world: &World, flaw: Flaw, clashes: Vec<Clash>) -> Box<Failure> {
        let rule = match flaw {
            Flaw::Open(open) => Some(world.rule(open)),
            _ => None,
        };
        let goal = match flaw {
            Flaw::Goal(place) => self.goals.get(place).cloned(),
            _ => None,
        };
        Box::new(Failure {
            flaw,
            rule,
            goal,
            clashes,
        })
    }

    pub(super) fn no_plan(&self, failure: &Failure) -> NoPlan {
        let tried: Vec<String> = { failure.clashes.iter() }
            .map(|&at| self.reason(at))
            .collect();
        let model = self.model();
        let asked = match (failure.flaw, failure.rule, &failure.goal) {
            (Flaw::Open(open), Some(rule), _) => {
                let relation = match open.part {
                    rules::Part::Relation(at) => {
                        Some(&self.tables.flats[rule].relations[usize::from(at)])
                    }
                    rules::Part::Choice(_) => None,
                };
                words::Asked::Rule(rule, relation)
            }
            (Flaw::Goal(_), _, Some(goal)) => words::Asked::Goal(goal.timeline, goal.predicate),
            (Flaw::Gap(timeline) | Flaw::Ahead(timeline), ..) => words::Asked::Default(timeline),
            _ => words::Asked::Default(0),
        };
        words::no_plan(model, asked, &tried)
    }
}
