//! The constraint-based temporal technology: tokens in a plan database, tied by times and values,
//! and a chronological search over what is due (the paper's EUROPA).
//!
//! # The order in a cycle
//!
//! 1. Statuses ([`bind`](PlanService::bind)), as they are posted.
//! 2. Timers: tokens whose longest duration is over end, with `TIMEOUT` if no status came.
//! 3. Goals that are taken back end, with `PREEMPTED` if no status came.
//! 4. What the model's search control names in its `:subgoal_order`, in that order: safety.
//! 5. Goals that came ([`insert_goal`](PlanService::insert_goal)), unless search control names them.
//! 6. All else that rules ask for: conditions before what is new, else in the order of asking.
//! 7. Timelines that say nothing: the next step of their plan, or else their default.
//!
//! So a status beats a timer or a pre-emption of the same cycle, in whatever order they are posted.
//! A step that completes as an alarm comes has completed, and what would follow it meets the alarm.

mod words;

use std::sync::Arc;

use farside_planning::Ticks;
use farside_planning::database::TokenId;
use farside_planning::model::{Model, PredicateId, Problem, TimelineId, TimelineKind, Value};
use farside_planning::search::Verdict;
use farside_planning::search::executive::{Executive, Following};
pub use farside_planning::search::executive::{MergeScan, Propagation};
use farside_planning::search::schedule::LoadError;
use thiserror::Error;

use super::check;
use super::{
    Contract, Ended, Outcome, Parameters, Plan, PlanService, Present, Refusal, ServiceCounters,
    Snapshot, Stale, Started,
};

/// How the temporal technology works.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TemporalOptions {
    /// Whether [`forget`](PlanService::forget) deletes anything.
    pub deletes: bool,
    /// Which tokens conditions are compared with.
    pub merge_scan: MergeScan,
    /// What is propagated after a decision or a status.
    pub propagation: Propagation,
    /// Whether statuses are guessed where [`solve`](PlanService::solve) looks further than now: the
    /// values that rules name first, as early as they may come. Else nothing is heard until then.
    pub guess: bool,
}

impl Default for TemporalOptions {
    fn default() -> Self {
        TemporalOptions {
            deletes: true,
            merge_scan: MergeScan::Near,
            propagation: Propagation::Incremental,
            guess: false,
        }
    }
}

/// Why a model or a problem is none for a technology.
#[derive(Debug, Error)]
pub enum Unfit {
    /// A timeline that may say nothing, or several things at once.
    #[error("{timeline}: an agent's timelines say exactly one thing at any time")]
    Timeline {
        /// Its name.
        timeline: String,
    },
    /// More timelines than contracts can name.
    #[error("{actual} timelines, expected {expected} at most")]
    Timelines {
        /// How many a model may have.
        expected: usize,
        /// How many it has.
        actual: usize,
    },
    /// What is the case at the start cannot be.
    #[error(transparent)]
    Facts(LoadError),
}

/// What is known of a timeline's present token.
#[derive(Clone, Copy, Debug, Default)]
struct Lane {
    token: Option<TokenId>,
    /// How many tokens had begun before it.
    number: u64,
    /// Whether a status ended it, though it may have to go on for a while.
    ends: bool,
}

/// The constraint-based temporal technology.
///
/// ```
/// use std::sync::Arc;
/// use farside_idea::service::{Contract, Outcome, PlanService};
/// use farside_idea::service::temporal::{Temporal, TemporalOptions};
/// use farside_planning::language::{Options, read_model};
/// # let text = include_str!("../../../planning/models/polling.ddl");
/// let model = read_model("polling.ddl", text, &Options::default()).value.expect("it is right");
/// let mut service = Temporal::new(Arc::new(model), TemporalOptions::default()).expect("it fits");
/// service.advance(0);
/// assert_eq!(service.solve(1, 10_000), Outcome::Decided);
/// let poll = service.started()[0].contract;
/// assert_eq!(poll, Contract { timeline: 0, number: 0 });
///
/// // Section 3.3 of the paper: a reading above the threshold starts the fan in the same cycle.
/// service.advance(1);
/// service.bind(poll, &[None, Some(301), Some(1)], true).expect("the poll is active");
/// assert_eq!(service.solve(1, 10_000), Outcome::Decided);
/// assert_eq!(service.ended()[0].parameters[0], Some(1));
/// let fan = &service.started()[1];
/// assert_eq!(service.model().predicates[fan.predicate].name, "DeviceSetFanState");
/// assert_eq!(fan.parameters[0], Some(1));
/// ```
pub struct Temporal {
    executive: Executive,
    options: TemporalOptions,
    model: Arc<Model>,
    now: Ticks,
    lanes: Vec<Lane>,
    started: Vec<Started>,
    ended: Vec<Ended>,
}

impl Temporal {
    /// With nothing on its timelines yet: the first cycle puts their defaults there.
    ///
    /// # Errors
    ///
    /// If a timeline of the model may say nothing or several things at once.
    pub fn new(model: Arc<Model>, options: TemporalOptions) -> Result<Self, Unfit> {
        Temporal::begin(model, &Problem::default(), options)
    }

    /// With what a problem says is the case at the start.
    ///
    /// # Errors
    ///
    /// As [`new`](Temporal::new), and if a fact cannot be, with those before it.
    pub fn begin(
        model: Arc<Model>,
        problem: &Problem,
        options: TemporalOptions,
    ) -> Result<Self, Unfit> {
        check_timelines(&model)?;
        let executive = Executive::begin(model.clone(), problem).map_err(Unfit::Facts)?;
        let mut executive = executive;
        executive.forgets = false;
        executive.work(options.merge_scan, options.propagation);
        let lanes = vec![Lane::default(); model.timelines.len()];
        Ok(Temporal {
            executive,
            options,
            model,
            now: 0,
            lanes,
            started: Vec::new(),
            ended: Vec::new(),
        })
    }

    /// The token of an active contract.
    fn active(&self, contract: Contract) -> Result<TokenId, Refusal> {
        let lane = self.lanes.get(usize::from(contract.timeline));
        let token = lane
            .filter(|lane| lane.number == contract.number && !lane.ends)
            .and_then(|lane| lane.token)
            .filter(|&token| self.executive.database().finish(token).max >= self.now);
        token.ok_or_else(|| check::dead(&self.model, contract))
    }

    fn parameters(&self, token: TokenId) -> Parameters {
        let database = self.executive.database();
        let at = database.token(token);
        let parameters = at.map_or(&[][..], |at| &at.parameters);
        parameters.iter().map(|&one| database.value(one)).collect()
    }

    fn predicate(&self, token: TokenId) -> PredicateId {
        let at = self.executive.database().token(token);
        at.expect("a timeline's token is there").predicate
    }

    /// What began and ended with a cycle that was decided.
    fn follow_timelines(&mut self) {
        for timeline in 0..self.lanes.len() {
            let lane = self.lanes[timeline];
            let database = self.executive.database();
            let mut next = match lane.token {
                Some(token) if database.last(timeline) == Some(token) => continue,
                Some(token) => {
                    self.note_end(timeline, token);
                    let at = self.executive.database().token(token);
                    at.and_then(farside_planning::database::Token::after)
                }
                None => database.first(timeline),
            };
            while let Some(token) = next {
                let database = self.executive.database();
                next = database
                    .token(token)
                    .and_then(farside_planning::database::Token::after);
                let lane = &mut self.lanes[timeline];
                lane.number += u64::from(lane.token.is_some());
                (lane.token, lane.ends) = (Some(token), false);
                if next.is_some() {
                    self.note_end(timeline, token);
                    continue;
                }
                let contract = self.contract(timeline);
                let (predicate, parameters) = (self.predicate(token), self.parameters(token));
                self.started.push(Started {
                    contract,
                    predicate,
                    parameters,
                });
            }
        }
    }

    fn contract(&self, timeline: TimelineId) -> Contract {
        Contract {
            timeline: timeline as u16,
            number: self.lanes[timeline].number,
        }
    }

    fn note_end(&mut self, timeline: TimelineId, token: TokenId) {
        let database = self.executive.database();
        let (start, finish) = (database.start(token).min, database.finish(token).min);
        let (contract, predicate) = (self.contract(timeline), self.predicate(token));
        let parameters = self.parameters(token);
        self.ended.push(Ended {
            contract,
            predicate,
            start,
            finish,
            parameters,
        });
    }
}

/// Whether each timeline says exactly one thing at any time, and can be named by a contract.
pub(super) fn check_timelines(model: &Model) -> Result<(), Unfit> {
    let expected = usize::from(u16::MAX) + 1;
    let actual = model.timelines.len();
    if actual > expected {
        return Err(Unfit::Timelines { expected, actual });
    }
    let other = { model.timelines.iter() }.find(|at| at.kind != TimelineKind::State);
    match other {
        Some(at) => Err(Unfit::Timeline {
            timeline: at.name.clone(),
        }),
        None => Ok(()),
    }
}

impl PlanService for Temporal {
    fn model(&self) -> &Arc<Model> {
        &self.model
    }

    fn advance(&mut self, now: Ticks) {
        self.now = now.max(self.now);
    }

    fn bind(
        &mut self,
        contract: Contract,
        outputs: &[Option<Value>],
        ends: bool,
    ) -> Result<(), Refusal> {
        let token = self.active(contract)?;
        let predicate = self.predicate(token);
        check::values(&self.model, predicate, "outputs", outputs)?;
        let reported = self.executive.report(token, outputs, ends, self.now);
        reported.map_err(|conflict| self.refusal(predicate, &conflict))?;
        self.lanes[usize::from(contract.timeline)].ends |= ends;
        Ok(())
    }

    fn insert_goal(
        &mut self,
        timeline: TimelineId,
        predicate: PredicateId,
        inputs: &[Value],
    ) -> Result<(), Refusal> {
        check::predicate(&self.model, timeline, predicate)?;
        let mut parameters: Parameters = inputs.iter().copied().map(Some).collect();
        check::values(&self.model, predicate, "inputs", &parameters)?;
        if self.executive.has_goal(timeline) {
            return Err(check::two_goals(&self.model, timeline, predicate));
        }
        parameters.resize(self.model.predicates[predicate].parameters.len(), None);
        let requested = self
            .executive
            .request(timeline, predicate, &parameters, self.now);
        requested.map_err(|conflict| self.refusal(predicate, &conflict))
    }

    fn cancel(&mut self, contract: Contract) -> Result<(), Refusal> {
        let token = self.active(contract)?;
        let predicate = self.predicate(token);
        let earliest = self.executive.database().finish(token).min;
        if earliest > self.now {
            return Err(check::lasts(&self.model, predicate, earliest));
        }
        let cancelled = self.executive.cancel(token, self.now);
        cancelled.map_err(|conflict| self.refusal(predicate, &conflict))
    }

    fn solve(&mut self, horizon: Ticks, budget: u64) -> Outcome {
        self.started.clear();
        self.ended.clear();
        let guess = self.options.guess;
        match self.executive.cycle_ahead(self.now, horizon, guess, budget) {
            Verdict::Solved => {
                self.follow_timelines();
                Outcome::Decided
            }
            Verdict::Impossible(failure) => Outcome::NoPlan(self.no_plan(&failure)),
            Verdict::OverBudget => Outcome::OverBudget,
        }
    }

    fn started(&self) -> &[Started] {
        &self.started
    }

    fn ended(&self) -> &[Ended] {
        &self.ended
    }

    fn present(&self, timeline: TimelineId) -> Option<Present> {
        let token = self.lanes.get(timeline)?.token?;
        Some(Present {
            contract: self.contract(timeline),
            predicate: self.predicate(token),
            start: self.executive.database().start(token).min,
            parameters: self.parameters(token),
        })
    }

    fn forget(&mut self, before: Ticks) {
        if self.options.deletes {
            self.executive.forget(before);
        }
    }

    fn counters(&self) -> ServiceCounters {
        let spent = self.executive.counters();
        let database = self.executive.database();
        ServiceCounters {
            operations: database.operations(),
            decisions: spent.decisions,
            backtracks: spent.backtracks,
            guards: spent.guards,
            tokens: database.len() as u64,
        }
    }

    fn now(&self) -> Ticks {
        self.now
    }

    fn commit(&mut self, snapshot: &Snapshot, plan: Plan) -> Result<(), Stale> {
        check::plan(&self.model, &plan, self.now)?;
        let timeline = plan.timeline;
        let was = snapshot.present.get(timeline).cloned().flatten();
        if was != self.present(timeline) || self.executive.is_posted(timeline) {
            return Err(Stale::Changed {
                timeline: self.model.timelines[timeline].name.clone(),
            });
        }
        let model = self.model.clone();
        let steps = plan.steps.into_iter().map(|step| {
            let mut parameters: smallvec::SmallVec<[Option<Value>; 4]> =
                step.inputs.into_iter().map(Some).collect();
            parameters.resize(model.predicates[step.predicate].parameters.len(), None);
            let branches = step.branches.into_iter();
            Following {
                predicate: step.predicate,
                parameters,
                not_before: step.not_before,
                branches: branches.map(|branch| (branch.when, branch.next)).collect(),
            }
        });
        self.executive.follow(timeline, steps.collect());
        Ok(())
    }

    fn drop_plan(&mut self, timeline: TimelineId) {
        self.executive.follow(timeline, Vec::new());
    }
}
