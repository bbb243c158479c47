//! Whether the rules of tokens hold: a search for the tokens and values that they speak of.

mod failure;
mod settle;

use std::ops::Range;

use super::{Bindings, Kind, Report, Scene, apart};
use crate::Ticks;
use crate::model::{Body, Bound, Distance, End, Pattern, Relation, Rule, Target, Value};
use crate::plan;
use failure::{Failure, Why};

/// The most steps of a search for one rule of one token.
const MAX_STEPS: u32 = 1 << 18;

/// The most steps for all rules of all tokens.
const ALL_STEPS: u32 = 1 << 24;

pub(super) fn check(scene: &Scene<'_>, report: &mut Report) {
    let mut rules_by_timeline = vec![Vec::new(); scene.model.timelines.len()];
    for rule in &scene.model.rules {
        for &timeline in &rule.master.timelines {
            rules_by_timeline[timeline].push(rule);
        }
    }
    let mut left = ALL_STEPS;
    for (index, seen) in scene.tokens.iter().enumerate() {
        let mut used = vec![false; seen.token.effects.len()];
        for &rule in &rules_by_timeline[seen.timeline] {
            if rule.master.predicate == seen.predicate {
                let steps = check_rule(scene, rule, index, &mut used, report);
                left = left.saturating_sub(steps);
            }
            if left == 0 {
                let message = format!("from token {} on, rules were not checked", seen.token);
                report.add(Kind::Undecided, message).tokens([seen.token.id]);
                return;
            }
        }
        for (effect, used) in seen.token.effects.iter().zip(used) {
            if !used {
                let (of, at) = (&effect.resource, &effect.place);
                let message = format!(
                    "token {} lists an effect on {of} that no rule has ({at})",
                    seen.token
                );
                report.add(Kind::Effect, message).tokens([seen.token.id]);
            }
        }
    }
}

/// Checks a rule of a token; `used` says which of its listed effects rules have accounted for. How
/// many steps it took.
fn check_rule<'a>(
    scene: &'a Scene<'a>,
    rule: &'a Rule,
    master: usize,
    used: &mut [bool],
    report: &mut Report,
) -> u32 {
    let mut search = Search {
        scene,
        rule,
        master,
        used,
        steps: 0,
        best: None,
    };
    let Some(state) = search.guard() else {
        return 1;
    };
    let bodies = Bodies::One(&rule.body);
    if search.step(&state, Some(&Rest { bodies, next: None })) {
        return search.steps + 1;
    }
    let seen = &scene.tokens[master];
    // That the rule does not hold is told once, and not once more for each of its effects.
    for (listed, used) in seen.token.effects.iter().zip(search.used.iter_mut()) {
        let mut places = rule
            .effects
            .iter()
            .map(|of| plan::place(scene.model, of.position));
        *used |= places.any(|place| place == listed.place);
    }
    let aborted = search.steps >= MAX_STEPS;
    match search.best.take().filter(|_| !aborted) {
        Some(failure) => failure.tell(scene, rule, seen, report),
        None => {
            let (kind, problem) = match aborted {
                true => (Kind::Undecided, "there are too many ways to try"),
                false => (Kind::Relation, "none of the alternatives is there"),
            };
            let message = format!("token {}: {problem}", seen.token);
            let added = report.add(kind, message).tokens([seen.token.id]);
            added.at(scene.place(rule.position));
        }
    }
    search.steps + 1
}

/// The search for what a rule speaks of.
struct Search<'a, 'u> {
    scene: &'a Scene<'a>,
    rule: &'a Rule,
    master: usize,
    used: &'u mut [bool],
    steps: u32,
    /// The failure that came after the most tokens were found.
    best: Option<Failure<'a>>,
}

/// Where a label is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Spot {
    /// Not found yet, or part of an alternative that is not taken.
    Nowhere,
    /// Where no token is asked for.
    Outside,
    /// A token.
    Token(usize),
}

/// What a search has found so far.
#[derive(Clone, Debug)]
struct State<'a> {
    bindings: Bindings,
    labels: Vec<Spot>,
    /// Distances whose bounds are not known yet, with their anchor and target.
    deferred: Vec<(&'a Relation, &'a Distance, usize, usize)>,
    /// Relations whose target is taken to lie outside the horizon, with their anchor: that it
    /// could lie nowhere else is not known yet.
    outside: Vec<(&'a Relation, usize)>,
    /// By effect of the rule, so far: the listed effect that it is, or none if it does nothing.
    effects: Vec<Option<usize>>,
}

/// What is still to be found: bodies, and then more.
#[derive(Clone, Copy)]
struct Rest<'r, 'a> {
    bodies: Bodies<'a>,
    next: Option<&'r Rest<'r, 'a>>,
}

#[derive(Clone, Copy)]
enum Bodies<'a> {
    One(&'a Body),
    All(&'a [Body]),
}

impl<'a> Search<'a, '_> {
    /// What is known when only the master is; none if the rule does not hold for it.
    fn guard(&self) -> Option<State<'a>> {
        let (rule, master) = (self.rule, &self.scene.tokens[self.master]);
        let mut state = State {
            bindings: Bindings::new(rule.variables.len()),
            labels: vec![Spot::Nowhere; rule.labels.max(1)],
            deferred: Vec::new(),
            outside: Vec::new(),
            effects: Vec::new(),
        };
        state.labels[0] = Spot::Token(self.master);
        if !self
            .scene
            .fits(&rule.master, master, &rule.variables, &mut state.bindings)
        {
            return None;
        }
        self.is_certain(&mut state).then_some(state)
    }

    /// Goes on with what is still to be found; true if all of it can be.
    fn step(&mut self, state: &State<'a>, rest: Option<&Rest<'_, 'a>>) -> bool {
        let Some(&Rest { bodies, next }) = rest else {
            return self.effects(state);
        };
        let (first, others) = match bodies {
            Bodies::One(body) => (body, None),
            Bodies::All([]) => return self.step(state, next),
            Bodies::All([first, others @ ..]) => (first, Some(Bodies::All(others))),
        };
        let after = others.map(|bodies| Rest { bodies, next });
        let after = after.as_ref().or(next);
        match first {
            Body::All(bodies) => {
                let bodies = Bodies::All(bodies);
                self.step(
                    state,
                    Some(&Rest {
                        bodies,
                        next: after,
                    }),
                )
            }
            Body::Any(bodies, _) => bodies.iter().any(|body| {
                let bodies = Bodies::One(body);
                self.step(
                    state,
                    Some(&Rest {
                        bodies,
                        next: after,
                    }),
                )
            }),
            Body::Relation(relation) => self.relation(state, relation, after),
        }
    }

    /// Tries the tokens that a relation can mean.
    fn relation(
        &mut self,
        state: &State<'a>,
        relation: &'a Relation,
        rest: Option<&Rest<'_, 'a>>,
    ) -> bool {
        let anchor = match state.labels.get(relation.anchor) {
            Some(Spot::Token(anchor)) => *anchor,
            Some(Spot::Outside) => return self.outside(state, relation, rest),
            Some(Spot::Nowhere) | None => return self.fail(state, Why::Apart(relation)),
        };
        let (pattern, label) = match &relation.target {
            Target::New(pattern, label) => (pattern, *label),
            Target::Label(label) => {
                return match state.labels.get(*label) {
                    Some(&Spot::Token(target)) => {
                        let mut state = state.clone();
                        match self.place_apart(&mut state, relation, anchor, target) {
                            true => self.step(&state, rest),
                            false => self.fail(&state, Why::Apart(relation)),
                        }
                    }
                    Some(Spot::Outside) => self.step(state, rest),
                    Some(Spot::Nowhere) | None => self.fail(state, Why::Apart(relation)),
                };
            }
        };
        let reach = self.reach(state, relation, anchor);
        let mut any = false;
        for &timeline in &pattern.timelines {
            for place in self.candidates(timeline, reach) {
                let list = match reach.by_end {
                    true => &self.scene.by_end[timeline],
                    false => &self.scene.by_start[timeline],
                };
                let target = list[place];
                if target == self.master {
                    continue;
                }
                self.steps += 1;
                if self.steps >= MAX_STEPS {
                    return false;
                }
                let Some(next) = self.found(state, relation, pattern, label, anchor, target) else {
                    continue;
                };
                any = true;
                if self.step(&next, rest) {
                    return true;
                }
            }
        }
        match self.is_outside(state, relation, anchor) {
            Some(true) => return self.outside(state, relation, rest),
            Some(false) => {}
            None => {
                let mut state = state.clone();
                state.outside.push((relation, anchor));
                if self.outside(&state, relation, rest) {
                    return true;
                }
            }
        }
        if !any {
            self.fail(state, Why::NoTarget(relation));
        }
        false
    }

    /// Whether a relation's target could only lie outside the horizon; none if that depends on
    /// bounds that are not known.
    fn is_outside(&self, state: &State<'a>, relation: &Relation, anchor: usize) -> Option<bool> {
        let Reach { start, end, .. } = self.reach(state, relation, anchor);
        let mut bounds = relation.distances.iter().flat_map(|at| [at.min, at.max]);
        let all_known = bounds.all(|bound| self.bounds(state, [bound; 2])[0].is_some());
        // Bounds that leave no time at all are not kept outside either.
        let any_time = start.0 <= start.1 && end.0 <= end.1;
        let outside = start.0 >= self.scene.problem.horizon || end.1 <= 0;
        all_known.then_some(any_time && outside)
    }

    /// Goes on without a token for a relation, since it could only lie outside the horizon.
    fn outside(
        &mut self,
        state: &State<'a>,
        relation: &'a Relation,
        rest: Option<&Rest<'_, 'a>>,
    ) -> bool {
        let mut state = state.clone();
        if let Target::New(_, label) = relation.target
            && let Some(spot) = state.labels.get_mut(label)
        {
            *spot = Spot::Outside;
        }
        self.step(&state, rest)
    }

    /// What is known once a label is a token; none if it cannot be.
    fn found(
        &mut self,
        state: &State<'a>,
        relation: &'a Relation,
        pattern: &Pattern,
        label: usize,
        anchor: usize,
        target: usize,
    ) -> Option<State<'a>> {
        let (scene, seen) = (self.scene, &self.scene.tokens[target]);
        // Without a copy first: most tokens do not fit.
        if seen.predicate != pattern.predicate {
            return None;
        }
        let mut next = state.clone();
        *next.labels.get_mut(label)? = Spot::Token(target);
        let fits = scene.fits(pattern, seen, &self.rule.variables, &mut next.bindings)
            && self.place_apart(&mut next, relation, anchor, target);
        if !fits {
            return None;
        }
        match self.propagate(&mut next) {
            Ok(()) => Some(next),
            Err(why) => {
                self.fail(&next, why);
                None
            }
        }
    }

    /// Whether two tokens are as far apart as a relation says. What it cannot say yet is deferred.
    fn place_apart(
        &self,
        state: &mut State<'a>,
        relation: &'a Relation,
        anchor: usize,
        target: usize,
    ) -> bool {
        for distance in &relation.distances {
            match self.is_apart(state, distance, anchor, target) {
                Some(true) => {}
                Some(false) => return false,
                None => state.deferred.push((relation, distance, anchor, target)),
            }
        }
        true
    }

    /// Whether two tokens are as far apart as a distance says; none if its bounds are not known.
    fn is_apart(
        &self,
        state: &State<'a>,
        distance: &Distance,
        anchor: usize,
        target: usize,
    ) -> Option<bool> {
        let tokens = &self.scene.tokens;
        let is = apart(distance, &tokens[anchor], &tokens[target]);
        is_within(is, self.bounds(state, [distance.min, distance.max]))
    }

    /// Bounds: for each whether it is known, and then what it is, if anything.
    fn bounds(&self, state: &State<'a>, bounds: [Bound; 2]) -> [Option<Option<Value>>; 2] {
        bounds.map(|bound| match bound {
            Bound::None => Some(None),
            Bound::Value(value) => Some(Some(value)),
            Bound::Variable(variable) => state.bindings.values[variable].map(Some),
        })
    }

    /// When a relation's target can start and end, as far as its bounds are known.
    fn reach(&self, state: &State<'a>, relation: &Relation, anchor: usize) -> Reach {
        let mut start = (Ticks::MIN, Ticks::MAX);
        let mut end = (Ticks::MIN, Ticks::MAX);
        for distance in &relation.distances {
            let from = self.scene.tokens[anchor].end(distance.from);
            let [min, max] = self
                .bounds(state, [distance.min, distance.max])
                .map(Option::flatten);
            let (low, high) = match distance.backward {
                false => (
                    min.map(|by| from.saturating_add(by)),
                    max.map(|by| from.saturating_add(by)),
                ),
                true => (
                    max.map(|by| from.saturating_sub(by)),
                    min.map(|by| from.saturating_sub(by)),
                ),
            };
            let of = match distance.to {
                End::Start => &mut start,
                End::Finish => &mut end,
            };
            of.0 = of.0.max(low.unwrap_or(Ticks::MIN));
            of.1 = of.1.min(high.unwrap_or(Ticks::MAX));
        }
        // What starts no later ends no earlier.
        end.0 = end.0.max(start.0);
        start.1 = start.1.min(end.1);
        let width = |(from, to): (Ticks, Ticks)| to.saturating_sub(from);
        Reach {
            start,
            end,
            by_end: width(end) < width(start),
        }
    }

    /// The tokens of a timeline that start or end where they must: places in one of its two lists.
    fn candidates(&self, timeline: usize, reach: Reach) -> Range<usize> {
        let (list, end, (from, to)) = match reach.by_end {
            true => (&self.scene.by_end[timeline], End::Finish, reach.end),
            false => (&self.scene.by_start[timeline], End::Start, reach.start),
        };
        let time = |&index: &usize| self.scene.tokens[index].end(end);
        let first = list.partition_point(|index| time(index) < from);
        let last = list.partition_point(|index| time(index) <= to);
        first..last.max(first)
    }

    /// Keeps a failure if it came later than the one that is known. It is always false.
    fn fail(&mut self, state: &State<'a>, why: Why<'a>) -> bool {
        let found = state.labels.iter().filter(|spot| **spot != Spot::Nowhere);
        let depth = 2 * found.count() + usize::from(!matches!(why, Why::NoTarget(_)));
        if self.best.as_ref().is_none_or(|best| best.depth < depth) {
            self.best = Some(Failure {
                depth,
                why,
                labels: state.labels.clone(),
                values: state.bindings.values.clone(),
            });
        }
        false
    }
}

/// When a token can start and end, from and to, and which of the two says more.
#[derive(Clone, Copy)]
struct Reach {
    start: (Ticks, Ticks),
    end: (Ticks, Ticks),
    by_end: bool,
}

/// Whether a value is within bounds; none if that depends on one that is not known.
fn is_within(is: Value, [min, max]: [Option<Option<Value>>; 2]) -> Option<bool> {
    let is_low = min.map(|min| min.is_some_and(|min| is < min));
    let is_high = max.map(|max| max.is_some_and(|max| is > max));
    match (is_low, is_high) {
        (Some(true), _) | (_, Some(true)) => Some(false),
        (Some(false), Some(false)) => Some(true),
        _ => None,
    }
}
