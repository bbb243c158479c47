//! An executive: a plan that is extended one latency ahead, cycle by cycle.
//!
//! Section 2 of the IDEA paper: an agent wakes at multiples of its latency, learns what ended and
//! which values came back, and decides what each timeline says until it wakes again. What it does
//! not need any more it deletes (section 4). What a relation asks for is *due* once the end that
//! it speaks of is now; a token that it asks for starts now, in place of the present one if that
//! may end, or is the one that started now already. A condition ([`Relation::condition`]) is
//! fulfilled by a token that is there, and by no other. Where a token ended and nothing was asked
//! for, a timeline says its default.
//!
//! [`Relation::condition`]: crate::model::Relation::condition

use std::sync::Arc;

use smallvec::SmallVec;

use super::schedule::LoadError;
use super::{Counters, Decision, Flaw, Stack, Strategy, Verdict, chronological};
use crate::Ticks;
use crate::database::{
    Cause, Conflict, Database, InstanceId, Open, Owner, Slot, Status, Step, Time, Token, TokenId,
    Wanted,
};
use crate::model::{
    End, Fact, Model, PredicateId, Problem, Target, TimelineId, TimelineKind, Value, Values,
};
use crate::parameters::Operand;
use crate::temporal::{FURTHEST, Span};

/// A plan that is extended one latency ahead.
///
/// ```
/// use std::sync::Arc;
/// use farside_planning::language::{Options, read_model};
/// use farside_planning::search::{Verdict, executive::Executive};
/// # let text = include_str!("../../models/polling.ddl");
/// let model = read_model("polling.ddl", text, &Options::default()).value.expect("it is right");
/// let mut executive = Executive::new(Arc::new(model));
/// assert!(matches!(executive.cycle(0, 10_000), Verdict::Solved));
/// ```
pub struct Executive {
    database: Database,
    now: Now,
    stack: Stack,
    begun: bool,
    /// Whether the past is deleted after each cycle.
    pub forgets: bool,
}

/// How an executive decides: all relations that are due, then the gaps.
#[derive(Clone, Debug)]
struct Now {
    tick: Ticks,
    /// By timeline: by place of a predicate on it: how early its subgoals come.
    order: Vec<Vec<u32>>,
    /// By predicate: what its statuses say if no status comes.
    endings: Vec<Endings>,
    /// Alternatives whose leading condition did not hold.
    guards: u64,
}

impl Executive {
    /// With nothing on its timelines yet: the first cycle puts their defaults there.
    pub fn new(model: Arc<Model>) -> Self {
        let order = subgoal_order(&model);
        let predicates = 0..model.predicates.len();
        let endings = predicates.map(|at| Endings::of(&model, at)).collect();
        Executive {
            database: Database::new(model, Span::new(0, FURTHEST)),
            now: Now {
                tick: 0,
                order,
                endings,
                guards: 0,
            },
            stack: Stack::default(),
            begun: false,
            forgets: true,
        }
    }

    /// With what a problem says is the case, as it is at the start of the horizon.
    ///
    /// # Errors
    ///
    /// If a fact cannot be, with those before it.
    pub fn begin(model: Arc<Model>, problem: &Problem) -> Result<Self, LoadError> {
        let mut executive = Executive::new(model);
        for (fact, at) in problem.facts.iter().enumerate() {
            let put = executive.put_fact(fact, at);
            put.map_err(|conflict| LoadError::Fact { fact, conflict })?;
        }
        Ok(executive)
    }

    fn put_fact(&mut self, fact: usize, at: &Fact) -> Result<(), Conflict> {
        let parameters: SmallVec<[Option<Operand>; 4]> = at
            .values
            .iter()
            .map(|value| value.map(Operand::Value))
            .collect();
        self.database.attempt(|database| {
            let known = |span: Span| (span.min == span.max).then_some(Time::At(span.min));
            let token = database.insert(Wanted {
                predicate: at.predicate,
                timeline: Some(at.timeline),
                parameters: &parameters,
                start: known(at.start),
                finish: known(at.finish),
                cause: Cause::Fact(fact),
            })?;
            let owner = Owner::Token(token);
            database.restrict_time(token, End::Start, at.start, owner)?;
            database.restrict_time(token, End::Finish, at.finish, owner)?;
            let (timeline, after) = (at.timeline, database.last(at.timeline));
            database.activate(token, Slot { timeline, after })
        })
    }

    /// Its database, to be asked.
    pub fn database(&self) -> &Database {
        &self.database
    }

    /// What its searches did.
    pub fn counters(&self) -> Counters {
        let mut counters = self.stack.counters;
        counters.guards += self.now.guards;
        counters
    }

    /// The token that a timeline says now.
    pub fn present(&self, timeline: TimelineId) -> Option<TokenId> {
        self.database.last(timeline)
    }

    /// Puts a token on a timeline from a tick on, as a goal from elsewhere does; the present one
    /// ends then.
    ///
    /// # Errors
    ///
    /// If it cannot be there: nothing changes.
    pub fn start(
        &mut self,
        timeline: TimelineId,
        predicate: PredicateId,
        parameters: &[Option<Value>],
        tick: Ticks,
    ) -> Result<TokenId, Conflict> {
        let parameters: Vec<Option<Operand>> = parameters
            .iter()
            .map(|value| value.map(Operand::Value))
            .collect();
        let (now, endings) = (tick, &self.now.endings);
        self.database.attempt(|database| {
            let after = make_room(database, endings, timeline, now)?;
            let token = database.insert(Wanted {
                predicate,
                timeline: Some(timeline),
                parameters: &parameters,
                start: Some(Time::At(now)),
                finish: None,
                cause: Cause::User,
            })?;
            database.activate(token, Slot { timeline, after })?;
            Ok(token)
        })
    }

    /// A status came back for a token: outputs have values now, and the token ends as soon as it
    /// may, if the status ends it.
    ///
    /// # Errors
    ///
    /// If an output cannot have the value, or the token not end: nothing changes.
    pub fn report(
        &mut self,
        token: TokenId,
        outputs: &[Value],
        ends: bool,
        tick: Ticks,
    ) -> Result<(), Conflict> {
        self.database.attempt(|database| {
            let Some(at) = database.token(token) else {
                return Ok(());
            };
            let inputs = database.model().predicates[at.predicate].inputs;
            for (place, &value) in outputs.iter().enumerate() {
                database.bind(token, inputs + place, value, Owner::Token(token))?;
            }
            if ends {
                let earliest = database.finish(token).min.max(tick);
                database.end(token, earliest)?;
            }
            Ok(())
        })
    }

    /// A cycle: all tokens whose time is over end, and what follows is decided, with at most so
    /// many operations. If it cannot be, nothing was decided.
    pub fn cycle(&mut self, tick: Ticks, budget: u64) -> Verdict {
        self.now.tick = tick;
        let begins = !std::mem::replace(&mut self.begun, true);
        if !begins {
            self.expire();
        }
        let verdict = chronological(&mut self.database, &mut self.now, &mut self.stack, budget);
        if self.forgets && matches!(verdict, Verdict::Solved) {
            self.database.forget(tick);
        }
        verdict
    }

    /// Tokens whose time is over have ended, and no status came for them.
    fn expire(&mut self) {
        for timeline in 0..self.database.lanes() {
            let Some(last) = self.database.last(timeline) else {
                continue;
            };
            let finish = self.database.finish(last);
            if finish.max > self.now.tick {
                continue;
            }
            let endings = &self.now.endings;
            // A model may say otherwise what it is when no status comes.
            let said = say_ending(&mut self.database, endings, last, Ending::TimedOut);
            drop(said);
            if finish.min != finish.max {
                let ended = self.database.end(last, finish.max);
                debug_assert!(ended.is_ok(), "it can last as long as it can");
            }
        }
    }
}

/// By timeline: by place of a predicate: how early its subgoals come, as the model's search control
/// says; those that it does not name come last, all alike.
fn subgoal_order(model: &Model) -> Vec<Vec<u32>> {
    let subgoals = &model.control.subgoals;
    let early = |timeline: TimelineId, predicate: PredicateId| {
        let named = subgoals.iter().position(|&at| at == (timeline, predicate));
        named.unwrap_or(subgoals.len()) as u32
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

/// How a token ends of which no status says how.
#[derive(Clone, Copy, Debug)]
enum Ending {
    TimedOut,
    Preempted,
}

/// The outputs of a predicate that say how a token ended, and what they say then: values of their
/// types that are named so.
#[derive(Clone, Debug, Default)]
struct Endings {
    timed_out: SmallVec<[(usize, Value); 1]>,
    preempted: SmallVec<[(usize, Value); 1]>,
}

impl Endings {
    fn of(model: &Model, predicate: PredicateId) -> Endings {
        let predicate = &model.predicates[predicate];
        let named = |name: &str| {
            let symbol = model.symbols.iter().position(|at| at == name);
            let outputs = predicate.parameters.iter().enumerate();
            let outputs = outputs
                .skip(predicate.inputs)
                .filter_map(|(place, output)| {
                    let symbol = symbol? as Value;
                    match &model.types[output.of].values {
                        Values::Symbols(all) if all.contains(&symbol) => Some((place, symbol)),
                        _ => None,
                    }
                });
            outputs.collect()
        };
        Endings {
            timed_out: named("TIMEOUT"),
            preempted: named("PREEMPTED"),
        }
    }
}

/// Binds the outputs of a token that say how it ended, if no status did.
fn say_ending(
    database: &mut Database,
    endings: &[Endings],
    token: TokenId,
    ending: Ending,
) -> Result<(), Conflict> {
    let Some(at) = database.token(token) else {
        return Ok(());
    };
    let outputs = match ending {
        Ending::TimedOut => &endings[at.predicate].timed_out,
        Ending::Preempted => &endings[at.predicate].preempted,
    };
    for &(place, value) in outputs {
        let is = database.token(token).map(|at| at.parameters[place]);
        if is.is_some_and(|is| database.value(is).is_none()) {
            database.bind(token, place, value, Owner::Token(token))?;
        }
    }
    Ok(())
}

/// Ends the present token of a timeline, if it is not over: the token after which a new one comes.
fn make_room(
    database: &mut Database,
    endings: &[Endings],
    timeline: TimelineId,
    now: Ticks,
) -> Result<Option<TokenId>, Conflict> {
    let Some(last) = database.last(timeline) else {
        return Ok(None);
    };
    if database.model().timelines[timeline].kind == TimelineKind::Free {
        return Ok(Some(last));
    }
    let finish = database.finish(last);
    if finish.max > now || finish.min != finish.max {
        database.end(last, now)?;
        say_ending(database, endings, last, Ending::Preempted)?;
    }
    Ok(Some(last))
}

impl Now {
    /// How early a subgoal comes; none, if it is not due.
    fn urgency(&self, database: &Database, open: Open) -> Option<u32> {
        let at = match open.step {
            Step::Relation(at) => at,
            // A choice is due with the first relation that it could ask for.
            Step::Choice(choice) => {
                let alternatives = database.alternatives(open.instance, choice);
                let steps = alternatives.iter().flatten();
                let dues = steps.filter_map(|&step| self.urgency(database, Open { step, ..open }));
                return dues.min();
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
        let timelines = database.model().timelines.iter().enumerate();
        for (timeline, at) in timelines {
            if at.kind != TimelineKind::State {
                continue;
            }
            let after = database.last(timeline);
            let over = match after {
                Some(last) => database.finish(last).max <= self.tick,
                None => true,
            };
            if over {
                return Some(Flaw::Gap { timeline, after });
            }
        }
        None
    }
}

impl Now {
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
        let all = timelines
            .iter()
            .flat_map(move |&timeline| std::iter::successors(database.last(timeline), before));
        all.filter(move |&token| self.fits(database, open, token))
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

impl Strategy for Now {
    fn next(&mut self, database: &mut Database) -> Option<Flaw> {
        let mut first: Option<(u32, Open)> = None;
        for &open in database.open() {
            if let Some(early) = self.urgency(database, open)
                && first.is_none_or(|(best, _)| early < best)
            {
                first = Some((early, open));
            }
        }
        match first {
            Some((_, open)) => Some(Flaw::Open(open)),
            None => self.gap(database),
        }
    }

    fn decisions(&mut self, database: &mut Database, flaw: Flaw, into: &mut Vec<Decision>) {
        let open = match flaw {
            Flaw::Open(open) => open,
            Flaw::Gap { timeline, after } => {
                into.push(Decision::Insert(Slot { timeline, after }));
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

    fn decide(
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
            (Flaw::Gap { .. }, Decision::Insert(slot)) => fill(database, slot, self.tick),
            _ => unreachable!("the decision is one for the flaw"),
        }
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

/// A timeline says its default from now on.
fn fill(database: &mut Database, slot: Slot, now: Ticks) -> Result<(), Conflict> {
    let model = database.model().clone();
    let timeline = &model.timelines[slot.timeline];
    let Some(default) = &timeline.default else {
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
        debug_assert_eq!(
            database.token(token).map(|at| at.status),
            Some(Status::Free)
        );
        database.activate(token, slot)
    })
}
