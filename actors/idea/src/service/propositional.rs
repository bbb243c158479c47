//! The propositional technology: ground predicates with symbolic arguments, one-tick steps, and
//! counters for durations.
//!
//! It knows no intervals of values and no network of times. A parameter has a value or has none; what
//! no guard tests is copied by reference, whatever it is. A token ends between two ticks that its
//! rules count out. A rule whose numbers tie tokens or times together is refused with its place; a
//! function of measured values is not, since its value is known with its arguments.
//!
//! The order in a cycle is that of [`temporal`](super::temporal), and so are its decisions wherever a
//! model needs no backtracking.

mod compact;
mod depth_first;
pub(super) mod rules;
pub(super) mod search;
pub(super) mod state;

use std::sync::Arc;

use farside_planning::Ticks;
use farside_planning::model::{
    Model, PredicateId, Problem, RelationshipKind, TimelineId, TypeId, Value, Values,
};
use farside_planning::temporal::Span;
use smallvec::SmallVec;
use thiserror::Error;

use rules::Flat;
pub use rules::Numeric;
use search::{Decision, Flaw, Followed, Goal, Place, World};
use state::{Clash, Origin, State, Token, What};

use super::temporal::Unfit;
use super::words;
use super::{
    Contract, Ended, Outcome, Parameters, Plan, PlanService, Present, Refusal, ServiceCounters,
    Snapshot, Stale, Started, check,
};

/// Why a model or a problem is none for the propositional technology.
#[derive(Debug, Error)]
pub enum NotPropositional {
    /// Its timelines are none for any technology.
    #[error(transparent)]
    Unfit(#[from] Unfit),
    /// A rule that it cannot hold.
    #[error(transparent)]
    Numeric(#[from] Numeric),
    /// What is the case at the start cannot be, by a rule or the timeline's kind.
    #[error("fact {fact} cannot be: {reason}")]
    Fact {
        /// Its place in the problem.
        fact: usize,
        /// Why.
        reason: String,
    },
}

/// Numbers of a type that has no more of them are as symbols.
const FEW_NUMBERS: i64 = 64;

/// A model, as this technology reads it.
#[derive(Debug)]
pub(super) struct Tables {
    pub(super) model: Arc<Model>,
    pub(super) flats: Vec<Flat>,
    /// By rule: by relation: how early its subgoal comes.
    early: Vec<Vec<u32>>,
}

impl Tables {
    fn of(model: Arc<Model>) -> Result<Tables, Numeric> {
        let rules = 0..model.rules.len();
        let flats: Vec<Flat> = rules
            .map(|rule| Flat::of(&model, rule))
            .collect::<Result<_, _>>()?;
        let early = |flat: &Flat| {
            let relations = flat.relations.iter();
            relations
                .map(|relation| rules::early(&model, relation))
                .collect()
        };
        Ok(Tables {
            early: flats.iter().map(early).collect(),
            flats,
            model,
        })
    }

    /// Whether a type has more numbers than are told apart one by one.
    pub(super) fn is_measured(&self, of: TypeId) -> bool {
        match &self.model.types[of].values {
            Values::Numbers(span) => span.max.saturating_sub(span.min) >= FEW_NUMBERS,
            _ => false,
        }
    }

    /// Whether a relationship holds of known values.
    pub(super) fn holds(&self, kind: RelationshipKind, values: &[Value]) -> bool {
        match kind {
            RelationshipKind::Equal => values.windows(2).all(|pair| pair[0] == pair[1]),
            RelationshipKind::Different => values[0] != values[1],
            RelationshipKind::Less => values[0] < values[1],
            RelationshipKind::AtMost => values[0] <= values[1],
            RelationshipKind::Sum => {
                let (last, others) = values.split_last().expect("it has operands");
                others
                    .iter()
                    .try_fold(0, |sum: Value, &one| sum.checked_add(one))
                    == Some(*last)
            }
            RelationshipKind::Product => {
                let (last, others) = values.split_last().expect("it has operands");
                others
                    .iter()
                    .try_fold(1, |all: Value, &one| all.checked_mul(one))
                    == Some(*last)
            }
            RelationshipKind::Table(table) => {
                let table = &self.model.tables[table];
                table
                    .rows
                    .chunks_exact(table.columns)
                    .any(|row| row == values)
            }
            RelationshipKind::Function(function) => {
                let (last, others) = values.split_last().expect("it has operands");
                (self.model.functions[function].call)(others).is_none_or(|is| is == *last)
            }
        }
    }

    /// What all rows of a table say that fit known values.
    fn certain(&self, table: usize, known: &[Option<Value>]) -> SmallVec<[(usize, Value); 4]> {
        let table = &self.model.tables[table];
        let fits = |row: &&[Value]| {
            { row.iter().zip(known) }
                .all(|(value, known)| known.is_none_or(|known| known == *value))
        };
        let mut rows = table.rows.chunks_exact(table.columns).filter(fits);
        let Some(first) = rows.next() else {
            return SmallVec::new();
        };
        let mut certain: SmallVec<[(usize, Value); 4]> = { first.iter().copied() }
            .enumerate()
            .filter(|&(place, _)| known[place].is_none())
            .collect();
        for row in rows {
            certain.retain(|&mut (place, value)| row[place] == value);
        }
        certain
    }
}

/// The propositional technology.
///
/// ```
/// use std::sync::Arc;
/// use farside_idea::service::{Outcome, PlanService, propositional::Propositional};
/// use farside_planning::language::{Options, read_model};
/// # let text = include_str!("../../../planning/models/polling.ddl");
/// let model = read_model("polling.ddl", text, &Options::default()).value.expect("it is right");
/// let mut service = Propositional::new(Arc::new(model)).expect("no number couples its tokens");
/// service.advance(0);
/// assert_eq!(service.solve(1, 10_000), Outcome::Decided);
/// ```
#[derive(Clone)]
pub struct Propositional {
    pub(super) tables: Arc<Tables>,
    pub(super) world: World,
    pub(super) now: Ticks,
    pub(super) begun: bool,
    /// By timeline: whether a status ended its token, though it may have to go on for a while.
    pub(super) ends: Vec<bool>,
    pub(super) goals: Vec<Goal>,
    /// How many statuses, goals and cancels were posted since the last cycle that was decided.
    pub(super) posted: u16,
    pub(super) cancels: Vec<TimelineId>,
    started: Vec<Started>,
    ended: Vec<Ended>,
    counters: ServiceCounters,
}

impl Propositional {
    /// With nothing on its timelines yet: the first cycle puts their defaults there.
    ///
    /// # Errors
    ///
    /// If a timeline may say nothing or several things, or numbers of a rule tie tokens together.
    pub fn new(model: Arc<Model>) -> Result<Self, NotPropositional> {
        Propositional::begin(model, &Problem::default())
    }

    /// With what a problem says is the case at the start.
    ///
    /// # Errors
    ///
    /// As [`new`](Propositional::new), and if a fact cannot be, with those before it.
    pub fn begin(model: Arc<Model>, problem: &Problem) -> Result<Self, NotPropositional> {
        super::temporal::check_timelines(&model)?;
        let tables = Arc::new(Tables::of(model.clone())?);
        let timelines = model.timelines.len();
        let world = World {
            state: State::of(&model),
            plans: vec![None; timelines],
            ..World::default()
        };
        let mut service = Propositional {
            tables,
            world,
            now: 0,
            begun: false,
            ends: vec![false; timelines],
            goals: Vec::new(),
            posted: 0,
            cancels: Vec::new(),
            started: Vec::new(),
            ended: Vec::new(),
            counters: ServiceCounters::default(),
        };
        for (fact, at) in problem.facts.iter().enumerate() {
            let wrong = |reason: &str| NotPropositional::Fact {
                fact,
                reason: reason.to_owned(),
            };
            if at.start.min != at.start.max || service.world.state.last(at.timeline).is_some() {
                return Err(wrong(
                    "one fact of a timeline with a known start is expected",
                ));
            }
            let (tables, world) = (service.tables.clone(), &mut service.world);
            let token = world.put(&tables, at.timeline, at.predicate, &at.values, at.start.min);
            let (finish, Span { min, max }) = (world.state.at(token).finish, at.finish);
            let put = { world.state.within(finish, min, max, None) }
                .and_then(|()| world.state.settle(&tables));
            put.map_err(|clash| wrong(&service.reason(clash)))?;
        }
        Ok(service)
    }

    /// Without what a copy does not need.
    pub(super) fn shrink(&mut self) {
        (self.started, self.ended) = (Vec::new(), Vec::new());
        (self.goals, self.cancels) = (Vec::new(), Vec::new());
    }

    /// How large it is, about.
    pub(super) fn bytes(&self) -> usize {
        let state = &self.world.state;
        size_of::<Propositional>()
            + state.cells.capacity() * size_of::<state::Known>()
            + state.finishes.capacity() * size_of::<state::Bounds>()
            + state.tokens.capacity() * size_of::<state::At>()
            + state.lanes.capacity() * size_of::<state::Lane>()
            + state.open.capacity() * size_of::<state::Open>()
    }

    fn active(&self, contract: Contract) -> Result<Token, Refusal> {
        let timeline = usize::from(contract.timeline);
        let lane = self.world.state.lanes.get(timeline);
        let token = lane
            .filter(|lane| self.begun && lane.number == contract.number && !self.ends[timeline])
            .and_then(|lane| lane.tokens.last().copied())
            .filter(|&token| self.world.state.finish(token).1 >= self.now);
        token.ok_or_else(|| check::dead(self.model(), contract))
    }

    fn reason(&self, clash: Clash) -> String {
        let what = match clash.what {
            What::Times => words::TIMES,
            What::Values => words::VALUES,
            What::Kind => words::KIND,
        };
        words::reason(self.model(), what, clash.rule.as_slice())
    }

    fn refusal(&self, predicate: PredicateId, clash: Clash) -> Refusal {
        Refusal::Rule {
            what: self.model().predicates[predicate].name.clone(),
            reason: self.reason(clash),
        }
    }

    /// Whether an edit can be; it is not done.
    fn try_out(&mut self, edit: impl FnOnce(&mut World) -> Result<(), Clash>) -> Result<(), Clash> {
        let mut world = self.world.clone();
        let edited = edit(&mut world);
        let outcome = edited.and_then(|()| world.state.settle(&self.tables));
        self.world.state.operations = world.state.operations;
        self.world.state.loose.set(world.state.loose.get());
        outcome
    }

    /// What is posted for this cycle, and whose time is over.
    fn begin_cycle(&self) -> World {
        let (tables, tick) = (&self.tables, self.now);
        let mut world = self.world.clone();
        if self.begun {
            for timeline in 0..world.state.lanes.len() {
                if !world.is_over(timeline, tick) {
                    continue;
                }
                let Some(last) = world.state.last(timeline) else {
                    continue;
                };
                if !world.is_open(tables, last, tick) {
                    continue;
                }
                let before = world.clone();
                let closed = world.close(tables, last, tick);
                if closed.and_then(|_| world.state.settle(tables)).is_err() {
                    // If its status cannot say so, it ends without.
                    let loose = world.state.loose.get();
                    world = before;
                    world.state.loose.set(loose);
                    let (finish, (_, max)) =
                        (world.state.at(last).finish, world.state.finish(last));
                    let ended = world.state.within(finish, max, max, None);
                    debug_assert!(ended.is_ok(), "it can last as long as it can");
                }
            }
        }
        world.barred.clear();
        for &timeline in &self.cancels {
            world.barred.push(timeline);
            if let Some(last) = world.state.last(timeline)
                && !world.is_over(timeline, tick)
            {
                let before = world.clone();
                let closed = world.close(tables, last, tick);
                if closed.and_then(|_| world.state.settle(tables)).is_err() {
                    let loose = world.state.loose.get();
                    world = before;
                    world.state.loose.set(loose);
                }
            }
        }
        world.goals = self.goals.iter().cloned().map(Some).collect();
        world
            .barred
            .extend(self.goals.iter().map(|goal| goal.timeline));
        world
    }

    fn values(&self, world: &World, token: Token) -> Parameters {
        let parameters = world.state.at(token).parameters.iter();
        parameters.map(|&cell| world.state.value(cell)).collect()
    }

    /// What began and ended with a cycle that was decided.
    fn follow_timelines(&mut self, world: &mut World) {
        for timeline in 0..world.state.lanes.len() {
            let tokens = world.state.lanes[timeline].tokens.clone();
            let before = self.world.state.lanes[timeline].tokens.len();
            // At the first cycle facts begin, too.
            let first = if self.begun {
                before.saturating_sub(1)
            } else {
                0
            };
            let known = self.begun && before > 0;
            let mut number = world.state.lanes[timeline].number;
            for (place, &token) in tokens.iter().enumerate().skip(first) {
                let is_known = known && place == first;
                number += u64::from(!is_known && (known || place > first));
                let contract = Contract {
                    timeline: timeline as u16,
                    number,
                };
                let (predicate, start) = {
                    let at = world.state.at(token);
                    (at.predicate, at.start)
                };
                let parameters = self.values(world, token);
                if place + 1 < tokens.len() {
                    self.ended.push(Ended {
                        contract,
                        predicate,
                        start,
                        finish: world.state.finish(token).0,
                        parameters,
                    });
                } else if !is_known {
                    self.ends[timeline] = false;
                    self.started.push(Started {
                        contract,
                        predicate,
                        parameters,
                    });
                }
            }
            world.state.lanes[timeline].number = number;
        }
    }
}

impl PlanService for Propositional {
    fn model(&self) -> &Arc<Model> {
        &self.tables.model
    }

    fn advance(&mut self, now: Ticks) {
        self.now = now.max(self.now);
        self.world.state.tick = self.now;
    }

    fn bind(
        &mut self,
        contract: Contract,
        outputs: &[Option<Value>],
        ends: bool,
    ) -> Result<(), Refusal> {
        let token = self.active(contract)?;
        let predicate = self.world.state.at(token).predicate;
        check::values(self.model(), predicate, "outputs", outputs)?;
        let mut world = self.world.clone();
        let inputs = self.model().predicates[predicate].inputs;
        let bound = (|| {
            let at = world.state.at(token);
            let (cells, finish) = (at.parameters.clone(), at.finish);
            for (place, (&cell, &value)) in { cells[inputs..].iter() }.zip(outputs).enumerate() {
                if let Some(value) = value {
                    let origin = Origin::Posted(self.posted, place as u16);
                    let from = (value, origin);
                    world.state.bind_from(&self.tables, cell, from, None)?;
                }
            }
            world.state.settle(&self.tables)?;
            if ends {
                let earliest = world.state.finish(token).0.max(self.now);
                world.state.within(finish, earliest, earliest, None)?;
                world.state.settle(&self.tables)?;
            }
            Ok(())
        })();
        bound.map_err(|clash| self.refusal(predicate, clash))?;
        self.world = world;
        self.posted += 1;
        self.ends[usize::from(contract.timeline)] |= ends;
        Ok(())
    }

    fn insert_goal(
        &mut self,
        timeline: TimelineId,
        predicate: PredicateId,
        inputs: &[Value],
    ) -> Result<(), Refusal> {
        check::predicate(self.model(), timeline, predicate)?;
        let values: Parameters = inputs.iter().copied().map(Some).collect();
        check::values(self.model(), predicate, "inputs", &values)?;
        if self.goals.iter().any(|goal| goal.timeline == timeline) {
            return Err(check::two_goals(self.model(), timeline, predicate));
        }
        let goal = Goal {
            timeline,
            predicate,
            inputs: inputs.iter().copied().collect(),
            early: check::goal_order(self.model(), timeline, predicate),
            posted: self.posted,
        };
        let (tables, tick) = (self.tables.clone(), self.now);
        let tried = self.try_out(|world| {
            world.goals = smallvec::smallvec![Some(goal.clone())];
            world.decide(&tables, tick, Flaw::Goal(0), Decision::Insert(timeline))
        });
        tried.map_err(|clash| self.refusal(predicate, clash))?;
        self.goals.push(goal);
        self.posted += 1;
        Ok(())
    }

    fn cancel(&mut self, contract: Contract) -> Result<(), Refusal> {
        let token = self.active(contract)?;
        let predicate = self.world.state.at(token).predicate;
        let (earliest, _) = self.world.state.finish(token);
        if earliest > self.now {
            return Err(check::lasts(self.model(), predicate, earliest));
        }
        let (tables, tick) = (self.tables.clone(), self.now);
        let tried = self.try_out(|world| world.close(&tables, token, tick).map(|_| ()));
        tried.map_err(|clash| self.refusal(predicate, clash))?;
        self.cancels.push(usize::from(contract.timeline));
        self.posted += 1;
        Ok(())
    }

    fn solve(&mut self, _horizon: Ticks, budget: u64) -> Outcome {
        self.started.clear();
        self.ended.clear();
        let mut world = self.begin_cycle();
        let outcome = self.search(&mut world, budget);
        self.world.state.operations = world.state.operations;
        match outcome {
            Ok(()) => {
                self.follow_timelines(&mut world);
                self.begun = true;
                self.posted = 0;
                let posted = self.goals.drain(..).map(|goal| goal.timeline);
                let posted: Vec<TimelineId> = posted.chain(self.cancels.drain(..)).collect();
                world.plans_go_on(self.now, &posted);
                world.compact(2);
                self.world = world;
                Outcome::Decided
            }
            Err(Some(failure)) => Outcome::NoPlan(self.no_plan(&failure)),
            Err(None) => Outcome::OverBudget,
        }
    }

    fn started(&self) -> &[Started] {
        &self.started
    }

    fn ended(&self) -> &[Ended] {
        &self.ended
    }

    fn present(&self, timeline: TimelineId) -> Option<Present> {
        let lane = self.world.state.lanes.get(timeline)?;
        let token = lane.tokens.last().copied().filter(|_| self.begun)?;
        let at = self.world.state.at(token);
        Some(Present {
            contract: Contract {
                timeline: timeline as u16,
                number: lane.number,
            },
            predicate: at.predicate,
            start: at.start,
            parameters: self.values(&self.world, token),
        })
    }

    /// Nothing is left to forget: no more than that is ever kept.
    fn forget(&mut self, _before: Ticks) {}

    fn counters(&self) -> ServiceCounters {
        ServiceCounters {
            operations: self.world.state.operations,
            tokens: self.world.state.tokens.len() as u64,
            ..self.counters
        }
    }

    fn now(&self) -> Ticks {
        self.now
    }

    fn commit(&mut self, snapshot: &Snapshot, plan: Plan) -> Result<(), Stale> {
        check::plan(self.model(), &plan, self.now)?;
        let timeline = plan.timeline;
        let was = snapshot.present.get(timeline).cloned().flatten();
        let posted = self.goals.iter().any(|goal| goal.timeline == timeline);
        if was != self.present(timeline) || posted || self.cancels.contains(&timeline) {
            return Err(Stale::Changed {
                timeline: self.model().timelines[timeline].name.clone(),
            });
        }
        self.world.plans[timeline] = (!plan.steps.is_empty()).then(|| Followed {
            steps: plan.steps.into(),
            place: Place::Before(0),
        });
        Ok(())
    }

    fn drop_plan(&mut self, timeline: TimelineId) {
        if let Some(plan) = self.world.plans.get_mut(timeline) {
            *plan = None;
        }
    }
}
