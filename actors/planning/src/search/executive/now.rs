//! How an executive decides what each timeline says now.

use std::cell::Cell;

use smallvec::SmallVec;

use super::ahead::Ahead;
use super::endings::{Endings, close, is_closed, make_room};
use super::later::Later;
use crate::Ticks;
use crate::database::{
    Cause, Conflict, Database, InstanceId, Open, Owner, Slot, Status, Step, Time, Token, TokenId,
    Wanted,
};
use crate::model::{End, Model, PredicateId, Target, TimelineId, TimelineKind};
use crate::parameters::Operand;
use crate::search::{Decision, Flaw, Strategy};
use crate::temporal::Span;

/// How an executive decides: all relations that are due, then the gaps.
#[derive(Clone, Debug)]
pub(super) struct Now {
    pub(super) tick: Ticks,
    /// The timelines of states, which have no gaps.
    states: Vec<TimelineId>,
    /// By timeline: by place of a predicate on it: how early its subgoals come.
    order: Vec<Vec<u32>>,
    /// By predicate: what its statuses say if no status comes.
    pub(super) endings: Vec<Endings>,
    /// Alternatives whose leading condition did not hold.
    pub(super) guards: u64,
    /// Goals of this cycle, each with how early it comes and its timeline.
    pub(super) goals: SmallVec<[(u32, TokenId, TimelineId); 2]>,
    /// What was planned ahead.
    pub(super) ahead: Ahead,
    /// The ticks after this cycle's that are looked at, and what was decided.
    pub(super) later: Later,
    /// Which tokens a relation is compared with.
    pub(super) scan: MergeScan,
    pub(super) propagation: Propagation,
    /// How many tokens were looked at, and not counted yet.
    pub(super) looked: Cell<u64>,
}

/// Which tokens of a timeline a condition is compared with: a factor of what cycles cost without
/// deletion (Figures 6 and 7 of the IDEA paper).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MergeScan {
    /// The present one and the one before it.
    #[default]
    Near,
    /// All that are known, from the present one back.
    All,
}

/// What is propagated after a decision or a status: the other factor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Propagation {
    /// What changed.
    #[default]
    Incremental,
    /// Everything that is known, as [`Database::propagate_fully`] does.
    Full,
}

/// By timeline: by place of a predicate: how early its subgoals come, as the model's search control
/// says; those that it does not name come last, all alike.
fn subgoal_order(model: &Model) -> Vec<Vec<u32>> {
    let subgoals = &model.control.subgoals;
    let early = |timeline: TimelineId, predicate: PredicateId| {
        let named = subgoals.iter().position(|&at| at == (timeline, predicate));
        // Between those that are named and those that are not come goals.
        named.unwrap_or(subgoals.len() + 1) as u32
    };
    let timelines = model.timelines.iter().enumerate();
    timelines
        .map(|(timeline, at)| {
            let predicates = at.predicates.iter();
            predicates
                .map(|&predicate| early(timeline, predicate))
                .collect()
        })
        .collect()
}

/// How early a goal is put on its timeline: as search control says, or else after all that it names
/// and before all that it does not.
pub(super) fn goal_order(model: &Model, timeline: TimelineId, predicate: PredicateId) -> u32 {
    let subgoals = &model.control.subgoals;
    let named = subgoals.iter().position(|&at| at == (timeline, predicate));
    2 * named.unwrap_or(subgoals.len()) as u32 + 1
}

impl Now {
    /// For a model, at tick 0.
    pub(super) fn of(model: &Model) -> Self {
        let predicates = 0..model.predicates.len();
        let states = model.timelines.iter().enumerate();
        let states = states.filter(|(_, at)| at.kind == TimelineKind::State);
        Now {
            tick: 0,
            states: states.map(|(timeline, _)| timeline).collect(),
            order: subgoal_order(model),
            endings: predicates.map(|at| Endings::of(model, at)).collect(),
            guards: 0,
            goals: SmallVec::new(),
            ahead: Ahead::of(model),
            later: Later::of(model),
            scan: MergeScan::Near,
            propagation: Propagation::Incremental,
            looked: Cell::new(0),
        }
    }

    /// How early a subgoal comes; none, if it is not due.
    fn urgency(&self, database: &Database, open: Open) -> Option<u32> {
        let at = match open.step {
            Step::Relation(at) => at,
            // A choice is due with the first relation that it could ask for, and comes with the first
            // token that it could insert: what its conditions ask for is decided before.
            Step::Choice(choice) => {
                let alternatives = database.alternatives(open.instance, choice);
                let steps = alternatives.iter().flatten();
                let dues = steps.filter_map(|&step| self.urgency(database, Open { step, ..open }));
                return dues.min_by_key(|&due| (due & 1 == 0, due));
            }
        };
        let relation = database.relation(open.instance, at);
        let instance = database.instance(open.instance)?;
        let anchor = instance.label(relation.anchor)?;
        for distance in &relation.distances {
            // That the target ends in some relation to the anchor does not say when it starts.
            if distance.to == End::Finish && relation.distances.len() > 1 {
                continue;
            }
            let from = database.bounds_of(database.time(anchor, distance.from));
            if from.min != from.max || from.max > self.tick {
                return None;
            }
            let span = database.span(open.instance, distance.min, distance.max, distance.backward);
            if span.min != Ticks::MIN && from.min.saturating_add(span.min) > self.tick {
                return None;
            }
        }
        let early = match &relation.target {
            Target::New(pattern, _) => {
                let timeline = pattern.timelines.first().copied()?;
                let predicates = &database.model().timelines[timeline].predicates;
                let place = predicates.iter().position(|&at| at == pattern.predicate)?;
                self.order[timeline][place]
            }
            Target::Label(_) => 0,
        };
        // Conditions are asked before anything new is made at the same rank.
        Some(2 * early + u32::from(!relation.condition))
    }

    /// A timeline of states whose last token is over, and nothing follows.
    fn gap(&self, database: &Database) -> Option<Flaw> {
        for &timeline in &self.states {
            let after = database.last(timeline);
            if after.is_none_or(|last| is_over(database, last, self.tick)) {
                return Some(Flaw::Gap { timeline, after });
            }
        }
        None
    }

    /// The next tick that is looked at: nothing is heard until then, or what is guessed. What is
    /// missing then; nothing at the end.
    fn look_on(&mut self, database: &mut Database) -> Option<Flaw> {
        while self.tick < self.later.until {
            if let Some(flaw) = self.later.unbound(database, self.tick) {
                return Some(flaw);
            }
            self.later.step(database, &mut self.tick);
            expire(database, &self.endings, self.tick);
            if let Some(flaw) = self.flaw(database) {
                return Some(flaw);
            }
        }
        None
    }

    /// Whether a token can be what a relation asks for, as far as its times and each of its
    /// parameters, taken alone, say.
    fn fits(&self, database: &Database, open: (InstanceId, u32), token: TokenId) -> bool {
        let (instance, relation) = open;
        let said = database.relation(instance, relation);
        let Some(at) = database.instance(instance) else {
            return false;
        };
        let Some(anchor) = at.label(said.anchor) else {
            return false;
        };
        let in_time = said.distances.iter().all(|distance| {
            let from = database.bounds_of(database.time(anchor, distance.from));
            let to = database.bounds_of(database.time(token, distance.to));
            let span = database.span(instance, distance.min, distance.max, distance.backward);
            to.max.saturating_sub(from.min) >= span.min
                && to.min.saturating_sub(from.max) <= span.max
        });
        in_time && database.fits(instance, relation, token)
    }

    /// The tokens that may fulfil a relation: the present one, and for a condition those before it
    /// that are still known.
    fn candidates<'a>(
        &'a self,
        database: &'a Database,
        open: (InstanceId, u32),
    ) -> impl Iterator<Item = TokenId> + 'a {
        let said = database.relation(open.0, open.1);
        let timelines: &[TimelineId] = match &said.target {
            Target::New(pattern, _) => &pattern.timelines,
            Target::Label(_) => &[],
        };
        let before = move |&token: &TokenId| {
            let known = database.token(token).filter(|_| said.condition);
            known.and_then(Token::before)
        };
        let all = timelines.iter().flat_map(move |&timeline| {
            let known = std::iter::successors(database.last(timeline), before);
            known.take(match self.scan {
                MergeScan::Near => 2,
                MergeScan::All => usize::MAX,
            })
        });
        all.filter(move |&token| {
            self.looked.set(self.looked.get() + 1);
            self.fits(database, open, token)
        })
    }

    /// Whether the leading condition of an alternative, if it has one, may hold.
    fn may_begin(&self, database: &Database, instance: InstanceId, steps: &[Step]) -> bool {
        match steps.first() {
            Some(&Step::Relation(relation)) => {
                !database.relation(instance, relation).condition
                    || self
                        .candidates(database, (instance, relation))
                        .next()
                        .is_some()
            }
            _ => true,
        }
    }
}

impl Now {
    /// What is missing at a tick.
    fn flaw(&self, database: &Database) -> Option<Flaw> {
        let mut first: Option<(u32, Open)> = None;
        for &open in database.open() {
            if let Some(early) = self.urgency(database, open)
                && first.is_none_or(|(best, _)| early < best)
            {
                first = Some((early, open));
            }
        }
        let goal = self.goals.iter().filter(|&&(_, token, _)| {
            let at = database.token(token);
            at.is_some_and(|at| at.status == Status::Free)
        });
        if let Some(&(early, token, _)) = goal.min_by_key(|goal| goal.0)
            && first.is_none_or(|(best, _)| early < best)
        {
            return Some(Flaw::Goal(token));
        }
        if let Some((_, open)) = first {
            return Some(Flaw::Open(open));
        }
        self.gap(database)
            .or_else(|| self.ahead.waiting(database, self.tick))
    }
}

impl Strategy for Now {
    fn next(&mut self, database: &mut Database) -> Option<Flaw> {
        if self.propagation == Propagation::Full {
            let missed = database.propagate_fully();
            debug_assert!(missed.is_ok(), "{missed:?}");
        }
        let missing = self.flaw(database);
        if missing.is_some() || self.tick >= self.later.until {
            return missing;
        }
        self.look_on(database)
    }

    fn decisions(&mut self, database: &mut Database, flaw: Flaw, into: &mut Vec<Decision>) {
        match self.later.script.pop() {
            Some(decision) => into.push(decision),
            None => self.ways(database, flaw, into),
        }
        database.spend(self.looked.take());
    }

    fn decide(
        &mut self,
        database: &mut Database,
        flaw: Flaw,
        decision: Decision,
    ) -> Result<(), Conflict> {
        self.carry_out(database, flaw, decision)?;
        self.later.note(database, self.tick, decision);
        Ok(())
    }

    fn undone(&mut self, database: &Database) {
        self.ahead.undone(database);
        self.later.undone(database, &mut self.tick);
    }

    fn is_guard(&self, database: &Database, before: Flaw, failed: Flaw) -> bool {
        match (before, failed) {
            (Flaw::Open(before), Flaw::Open(failed)) => {
                let is_choice = matches!(before.step, Step::Choice(_));
                let Step::Relation(relation) = failed.step else {
                    return false;
                };
                is_choice
                    && before.instance == failed.instance
                    && database.relation(failed.instance, relation).condition
            }
            _ => false,
        }
    }
}

impl Now {
    /// The decisions that may put a flaw right, the best one first.
    fn ways(&mut self, database: &mut Database, flaw: Flaw, into: &mut Vec<Decision>) {
        let open = match flaw {
            Flaw::Open(open) => open,
            Flaw::Gap { timeline, after } => {
                if let Some(step) = self.ahead.next(database, timeline, self.tick) {
                    into.push(Decision::Alternative(step));
                }
                into.push(Decision::Insert(Slot { timeline, after }));
                return;
            }
            Flaw::Unbound { token, parameter } => {
                self.later.guesses(database, token, parameter, into);
                return;
            }
            Flaw::Goal(token) => {
                let goal = self.goals.iter().find(|goal| goal.1 == token);
                into.extend(goal.map(|&(_, _, timeline)| {
                    let after = database.last(timeline);
                    Decision::Insert(Slot { timeline, after })
                }));
                return;
            }
            _ => return,
        };
        let relation = match open.step {
            Step::Choice(choice) => {
                let alternatives = database.alternatives(open.instance, choice);
                for (place, steps) in (0..).zip(alternatives) {
                    if self.may_begin(database, open.instance, steps) {
                        into.push(Decision::Alternative(place));
                    } else {
                        self.guards += 1;
                    }
                }
                return;
            }
            Step::Relation(relation) => relation,
        };
        let said = database.relation(open.instance, relation);
        let Target::New(pattern, _) = &said.target else {
            into.push(Decision::Relate);
            return;
        };
        let candidates = self.candidates(database, (open.instance, relation));
        into.extend(candidates.map(Decision::Support));
        if said.condition {
            return;
        }
        for &timeline in &pattern.timelines {
            let last = database.last(timeline);
            // What started now was decided now.
            let fresh = |last| database.start(last) == Span::exactly(self.tick);
            let free = database.model().timelines[timeline].kind == TimelineKind::Free;
            if free || !last.is_some_and(fresh) {
                into.push(Decision::Insert(Slot {
                    timeline,
                    after: last,
                }));
            }
        }
    }

    fn carry_out(
        &mut self,
        database: &mut Database,
        flaw: Flaw,
        decision: Decision,
    ) -> Result<(), Conflict> {
        let now = Some(Time::At(self.tick));
        match (flaw, decision) {
            (Flaw::Open(Open { instance, step }), decision) => match (step, decision) {
                (Step::Choice(choice), Decision::Alternative(alternative)) => {
                    database.choose(instance, choice, alternative);
                    Ok(())
                }
                (Step::Relation(relation), Decision::Support(token)) => {
                    database.support(instance, relation, token)
                }
                (Step::Relation(relation), Decision::Insert(slot)) => {
                    database.attempt(|database| {
                        let after = make_room(database, &self.endings, slot.timeline, self.tick)?;
                        let slot = Slot { after, ..slot };
                        database.insert_for(instance, relation, slot, now)?;
                        Ok(())
                    })
                }
                (Step::Relation(relation), Decision::Relate) => {
                    database.relate_labels(instance, relation)
                }
                _ => unreachable!("the decision is one for the flaw"),
            },
            (Flaw::Goal(token), Decision::Insert(slot)) => database.attempt(|database| {
                let after = make_room(database, &self.endings, slot.timeline, self.tick)?;
                database.activate(token, Slot { after, ..slot })
            }),
            (Flaw::Unbound { token, parameter }, Decision::Bind(value)) => {
                self.later
                    .guess(database, (token, parameter), value, self.tick)
            }
            (Flaw::Gap { timeline, after }, Decision::Alternative(step)) => {
                let slot = Slot { timeline, after };
                if let Some(after) = after
                    && is_over(database, after, self.tick)
                    && close(database, &self.endings, after, self.tick)?
                {
                    return Ok(());
                }
                let after = make_room(database, &self.endings, timeline, self.tick)?;
                let slot = Slot { after, ..slot };
                self.ahead.start(database, slot, step, self.tick)
            }
            (Flaw::Gap { timeline, after }, Decision::Insert(slot)) => {
                if after.is_some_and(|after| !is_over(database, after, self.tick)) {
                    self.ahead.decline(database, timeline);
                    return Ok(());
                }
                fill(database, &self.endings, slot, self.tick)
            }
            _ => unreachable!("the decision is one for the flaw"),
        }
    }
}

/// Whether a token has ended by a tick.
fn is_over(database: &Database, token: TokenId, tick: Ticks) -> bool {
    database.has_ended(token, tick)
}

/// A timeline says its default from now on, or what it says first.
fn fill(
    database: &mut Database,
    endings: &[Endings],
    slot: Slot,
    now: Ticks,
) -> Result<(), Conflict> {
    // What ended by what was decided in this cycle says so, and what follows from that may be
    // another token than the default.
    if let Some(after) = slot.after
        && close(database, endings, after, now)?
    {
        return Ok(());
    }
    let model = database.model().clone();
    let timeline = &model.timelines[slot.timeline];
    let first = timeline.initial.as_ref().filter(|_| slot.after.is_none());
    let Some(default) = first.or(timeline.default.as_ref()) else {
        let owner = match slot.after {
            Some(after) => Owner::Token(after),
            None => Owner::Past,
        };
        return Err(Conflict::Mismatch { owner });
    };
    let parameters = default.values.iter().map(|value| value.map(Operand::Value));
    let parameters: SmallVec<[Option<Operand>; 4]> = parameters.collect();
    database.attempt(|database| {
        let token = database.insert(Wanted {
            predicate: default.predicate,
            timeline: Some(slot.timeline),
            parameters: &parameters,
            start: Some(Time::At(now)),
            finish: None,
            cause: Cause::Filler,
        })?;
        database.activate(token, slot)
    })
}

/// Tokens whose time is over have ended, and no status came for them.
pub(super) fn expire(database: &mut Database, endings: &[Endings], tick: Ticks) {
    for timeline in 0..database.lanes() {
        let Some(last) = database.last(timeline) else {
            continue;
        };
        if !is_over(database, last, tick) || is_closed(database, endings, last) {
            continue;
        }
        // If its status cannot say so, it ends without.
        let closed = database.attempt(|at| close(at, endings, last, tick));
        if closed.is_err() {
            let latest = database.finish(last).max;
            let ended = database.end(last, latest);
            debug_assert!(ended.is_ok(), "it can last as long as it can");
        }
    }
}
