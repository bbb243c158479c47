//! Which goals a rover takes and gives back.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;

use farside::prelude::*;

use super::{Explorer, millis};
use crate::analysis::goals::{GoalId, Observation};
use crate::planner::problem::ProblemError;
use crate::shac::{GoalKey, Holding, Owner, OwnerError, Parameters, Reason, SharedGoal};
use crate::sharing::{RoverMind, RoverMove};
use crate::survey::costs::Cost;
use crate::survey::messages::{Activity, GoalList, ListedGoal, ReplanCause};
use crate::survey::outlook::{OwnGoal, WAITS, Worth};
use crate::survey::shared::Shared;

/// The share of rocks for which a rover expects to look round before it has seen any, and how fast it learns
/// better.
const SEARCHES: f64 = 0.5;
const LEARNS: f64 = 0.25;

/// What a rover answers to offers, and what it has decided to give back.
pub(super) struct Desk {
    shared: Arc<Shared>,
    /// What is to be said next.
    pub(super) moves: VecDeque<RoverMove>,
    /// Goals that are not taken again in this sol, and why.
    pub(super) refuses: BTreeMap<GoalKey, Reason>,
    /// What goals that are called out would add to the score; none for those that do not fit.
    pub(super) bids: BTreeMap<GoalKey, Option<f64>>,
    /// What is done for goals that have no name of the analysis, as the list says.
    pub(super) observations: BTreeMap<GoalKey, Observation>,
}

impl Desk {
    pub(super) fn new(shared: Arc<Shared>) -> Desk {
        Desk {
            shared,
            moves: VecDeque::new(),
            refuses: BTreeMap::new(),
            bids: BTreeMap::new(),
            observations: BTreeMap::new(),
        }
    }

    /// Why a goal cannot be this rover's; None if it can.
    fn refuses(&self, goal: GoalKey) -> Option<Reason> {
        match Cost::of(self.observation(goal), &self.shared.rover) {
            Some(_) => self.refuses.get(&goal).copied(),
            None => Some(Reason::Hardware),
        }
    }

    /// What is done for a goal. What the list has not yet and has no name of the analysis is taken for an image
    /// of what is around.
    pub(super) fn observation(&self, goal: GoalKey) -> Observation {
        match goal {
            GoalKey::Observation(id) => id.observation,
            GoalKey::Numbered(_) => {
                let listed = self.observations.get(&goal);
                listed.copied().unwrap_or(Observation::PanoramicImage)
            }
        }
    }

    /// Learns what is done for which goal.
    pub(super) fn read(&mut self, list: &GoalList) {
        let goals = list.goals.iter();
        let numbered = goals.filter(|goal| matches!(goal.key, GoalKey::Numbered(_)));
        self.observations = numbered.map(|goal| (goal.key, goal.observation)).collect();
    }
}

impl RoverMind for Desk {
    fn next(
        &mut self,
        _now: SimTime,
        owner: &Owner,
        _refused: Option<&OwnerError>,
    ) -> Option<RoverMove> {
        // What the protocol refuses has been overtaken, by a lease's end or another rover's outcome.
        if let Some(next) = self.moves.pop_front() {
            return Some(next);
        }
        if let Some(offer) = owner.offers().next() {
            let key = offer.goal.key;
            return Some(match self.refuses(key) {
                Some(reason) => RoverMove::Refuse(key, reason),
                None => RoverMove::Accept(key),
            });
        }
        let call = owner
            .calls()
            .find(|call| self.bids.contains_key(&call.goal.key))?;
        let key = call.goal.key;
        let score = self.bids.remove(&key)?;
        Some(RoverMove::Bid(key, score))
    }

    fn wake(&self) -> SimTime {
        SimTime::MAX
    }
}

impl Explorer {
    /// What the list says of a goal.
    pub(super) fn listed(&self, goal: GoalKey) -> Option<&ListedGoal> {
        self.log.list.goals.iter().find(|listed| listed.key == goal)
    }

    /// What is held and has not been done, by name.
    fn holdings(&self) -> impl Iterator<Item = &Holding> {
        let owner = self.seat.owner().into_iter();
        owner.flat_map(|owner| owner.durable().held.values())
    }

    pub(super) fn holds(&self, goal: GoalKey) -> bool {
        self.holdings().any(|holding| holding.goal.key == goal)
    }

    /// Says what is to be said to the others, and looks at what has changed by what they say.
    pub(super) fn settle_goals(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        self.bid_for_calls(Self::now_ms(ctx))?;
        self.seat.think(&mut self.desk, ctx)?;
        let now = self.held_keys();
        let lost: Vec<GoalKey> = self.planned_goals().difference(&now).copied().collect();
        if !lost.is_empty() {
            self.forget(&lost, ctx)?;
            self.plan_anew(ReplanCause::Goals);
        }
        if self.is_news(&self.plannable_keys()) {
            self.plan_anew(ReplanCause::Goals);
        }
        if self.others_changed() {
            self.has_gained = true;
            self.plan_anew(ReplanCause::Worth);
        }
        self.go_on(ctx)
    }

    /// Whether there are goals that neither the plan in force nor one in hand was made for.
    fn is_news(&self, held: &BTreeSet<GoalKey>) -> bool {
        let plans = self.log.plan.iter();
        let plans = plans.chain(self.in_hand.iter().map(|in_hand| &in_hand.plan));
        let known: BTreeSet<GoalKey> = plans.flat_map(|plan| plan.for_goals()).collect();
        !held.is_subset(&known)
    }

    pub(super) fn held_keys(&self) -> BTreeSet<GoalKey> {
        self.holdings().map(|holding| holding.goal.key).collect()
    }

    /// Whether a goal may be planned: half of one for two rovers only when another rover is bound to the other
    /// half.
    fn is_plannable(holding: &Holding) -> bool {
        holding.goal.partner.is_none() || holding.confirmed
    }

    fn plannable_keys(&self) -> BTreeSet<GoalKey> {
        let plannable = self.holdings().filter(|one| Self::is_plannable(one));
        plannable.map(|holding| holding.goal.key).collect()
    }

    /// Goals that run or are ahead.
    fn planned_goals(&self) -> BTreeSet<GoalKey> {
        let under = self.log.under.iter().map(|under| under.piece.activity);
        let ahead = self.log.ahead.iter().map(|piece| piece.activity);
        under.chain(ahead).filter_map(goal_of).collect()
    }

    /// Whether others hold or have achieved other goals than when the last plan was made, as far as it is
    /// of weight here.
    fn others_changed(&self) -> bool {
        let made_for = match (&self.in_hand, &self.log.plan) {
            (Some(in_hand), _) => in_hand.plan.held(),
            (None, Some(plan)) => plan.held(),
            (None, None) => return false,
        };
        let combined = self.combined();
        let before = made_for.intersection(&combined);
        !before.eq(&self.held_by_others())
    }

    /// The goals of others that are combined with own goals.
    fn combined(&self) -> BTreeSet<GoalKey> {
        let own = self.held_keys();
        let combined = self.log.list.combinations.iter();
        let combined = combined.filter(|at| at.goals.iter().any(|goal| own.contains(goal)));
        let goals = combined.flat_map(|at| &at.goals).copied();
        goals.filter(|goal| !own.contains(goal)).collect()
    }

    /// What others were last heard to hold or have achieved, of what is combined with own goals.
    pub(super) fn held_by_others(&self) -> BTreeSet<GoalKey> {
        let Some(owner) = self.seat.owner() else {
            return BTreeSet::new();
        };
        let durable = owner.durable();
        let is_open = |goal: &GoalKey| {
            let others = (0..self.shared.settings.rovers).filter(|other| *other != self.number);
            let mut told = others.filter_map(|other| owner.told_by(other));
            let is_held = told.any(|told| {
                let mut held = told.holdings.iter();
                held.any(|held| held.goal == *goal && held.state.is_open())
            });
            let mut done = durable.outcomes.of(*goal);
            let mut own = self.holdings();
            let is_bound = own.any(|own| own.goal.partner == Some(*goal) && own.confirmed);
            is_held || is_bound || done.any(|outcome| outcome.rover != self.number)
        };
        self.combined().into_iter().filter(is_open).collect()
    }

    /// What this rover has achieved.
    pub(super) fn achieved(&self) -> BTreeSet<GoalKey> {
        let owner = self.seat.owner().into_iter();
        let outcomes = owner.flat_map(|owner| owner.durable().outcomes.iter());
        let own = outcomes.filter(|outcome| outcome.rover == self.number);
        own.map(|outcome| outcome.goal).collect()
    }

    /// What goals are worth: by the list, and those that are not on it by what the centre said.
    pub(super) fn worth(&self) -> Worth {
        let listed = self.log.list.goals.iter();
        let mut weights: BTreeMap<GoalKey, f64> =
            listed.map(|goal| (goal.key, goal.weight)).collect();
        if self.log.list.edition == 0 {
            let held = self.holdings().map(|holding| &holding.goal);
            weights.extend(held.map(|goal| (goal.key, goal.parameters.weight)));
        }
        Worth {
            weights,
            combinations: self.log.list.combinations.clone(),
        }
    }

    /// The goals that may be planned.
    pub(super) fn own_goals(&self) -> Vec<OwnGoal> {
        let goals = self.holdings().filter(|one| Self::is_plannable(one));
        let goals = goals.filter_map(|one| {
            let mut own = self.own_goal(one.goal.key, &one.goal.parameters)?;
            if one.goal.partner.is_some() {
                // Both are there at one time, or not at all.
                let waits_ms = (WAITS.as_nanos() / 1_000_000) as i64;
                let closes_ms = millis(one.goal.parameters.start) + waits_ms + own.duration_ms;
                own.window_ms[1] = own.window_ms[1].min(closes_ms);
            }
            Some(own)
        });
        goals.collect()
    }

    fn own_goal(&self, key: GoalKey, parameters: &Parameters) -> Option<OwnGoal> {
        let listed = self.listed(key);
        let position_m = listed.map_or(parameters.target_m, |listed| listed.position_m);
        let mut cost = self.cost(key)?;
        if self.there_m != Some(position_m) {
            self.add_search(key, &mut cost);
        }
        let means = self.outlook.means();
        let tried = self.log.tried.get(&key);
        let mut window_ms = [millis(parameters.start), i64::MAX];
        if let Some(window) = listed.and_then(|listed| listed.window) {
            window_ms[0] = window_ms[0].max(millis(window.opens));
            window_ms[1] = millis(window.closes);
        }
        window_ms[0] = window_ms[0].max(tried.map_or(0, |(_, from_ms)| *from_ms));
        Some(OwnGoal {
            key,
            position_m,
            duration_ms: (cost.duration.as_nanos() / 1_000_000) as i64,
            power_w: means.beyond_body_w(&cost),
            memory_bits: cost.memory_bits,
            mandatory: listed.is_some_and(|listed| listed.mandatory),
            window_ms,
            requires: listed.map_or(Vec::new(), |listed| listed.requires.clone()),
        })
    }

    /// What an observation takes: a spectrum is taken only once an image has shown that the mast points at
    /// the rock.
    pub(super) fn cost(&self, goal: GoalKey) -> Option<Cost> {
        let observation = self.desk.observation(goal);
        let mut cost = Cost::of(observation, &self.shared.rover)?;
        if observation == Observation::PointSpectrum
            && self.shared.site.instruments.camera.is_some()
            && let Some(image) = Cost::of(Observation::PointImage, &self.shared.rover)
        {
            cost.duration = cost.duration + image.duration;
            cost.memory_bits += image.memory_bits;
        }
        Some(cost)
    }

    /// What looking round for a rock takes.
    pub(super) fn search_cost(&self) -> Option<Cost> {
        self.shared.site.instruments.panorama.as_ref()?;
        let [mut cost, image] = [Observation::PanoramicImage, Observation::PointImage]
            .map(|one| Cost::of(one, &self.shared.rover));
        if let (Some(cost), Some(image)) = (&mut cost, image) {
            cost.duration = cost.duration + image.duration;
            cost.memory_bits += image.memory_bits;
        }
        cost
    }

    /// Adds what it takes in the mean to look round for a rock that is missed at first, to the first
    /// observation that is made of it.
    fn add_search(&self, goal: GoalKey, cost: &mut Cost) {
        let GoalKey::Observation(id) = goal else {
            return;
        };
        let image = GoalKey::Observation(GoalId {
            observation: Observation::PointImage,
            ..id
        });
        let is_first = match id.observation {
            Observation::PointImage => true,
            Observation::PointSpectrum => !self.holds(image),
            Observation::PanoramicImage | Observation::PanoramicSpectrum => false,
        };
        if let Some(search) = self.search_cost().filter(|_| is_first) {
            let share = self.log.searches.unwrap_or(SEARCHES);
            let lasts_s = share * search.duration.as_secs_f64();
            cost.duration = cost.duration + SimDuration::from_secs_f64(lasts_s);
            cost.memory_bits += (share * search.memory_bits as f64) as i64;
        }
    }

    /// Counts whether a rock was seen at once.
    pub(super) fn note_search(&mut self, has_searched: bool) {
        let before = self.log.searches.unwrap_or(SEARCHES);
        let now = f64::from(u8::from(has_searched));
        self.log.searches = Some(before + LEARNS * (now - before));
    }

    /// What goals that bids are called for would add to the score: by how much a plan that is made with one is
    /// better than one made without, whatever it displaces.
    fn bid_for_calls(&mut self, now_ms: i64) -> Outcome {
        let owner = self.seat.owner().into_iter();
        let calls: Vec<SharedGoal> = owner.flat_map(Owner::calls).map(|call| call.goal).collect();
        let Some((_, state)) = self.state.clone().filter(|_| !calls.is_empty()) else {
            return Ok(());
        };
        let has_gained = self.has_gained;
        let known = self.known(now_ms, &state, ReplanCause::Goals);
        self.has_gained = has_gained;
        let (number, before) = (self.log.plans, self.log.plan.as_ref());
        let failed = |error: ProblemError| HandlerError::new(error.to_string());
        let without = self.outlook.plan(&known, before, number).map_err(failed)?;
        self.bid_operations += without.operations;
        for goal in calls {
            let own = self.own_goal(goal.key, &goal.parameters);
            let own = own.filter(|_| self.desk.refuses(goal.key).is_none());
            let Some(own) = own else {
                self.desk.bids.insert(goal.key, None);
                continue;
            };
            let mut known = known.clone();
            let weight = goal.parameters.weight;
            known.worth.weights.entry(goal.key).or_insert(weight);
            known.goals.push(own);
            let with = self.outlook.plan(&known, Some(&without), number);
            let with = with.map_err(failed)?;
            self.bid_operations += with.operations;
            let is_planned = with.goals().any(|planned| planned == goal.key);
            let bid = is_planned.then_some(with.value - without.value);
            self.desk.bids.insert(goal.key, bid);
        }
        Ok(())
    }

    /// Drops what is planned for goals that are not held any more. What has begun for one goes on, but for a
    /// drive to it.
    fn forget(&mut self, lost: &[GoalKey], ctx: &mut Context<'_, Self>) -> Outcome {
        let is_lost = |activity| goal_of(activity).is_some_and(|goal| lost.contains(&goal));
        self.log.ahead.retain(|piece| !is_lost(piece.activity));
        if let Some(in_hand) = &mut self.in_hand {
            in_hand.is_stale |= in_hand.plan.pieces.iter().any(|at| is_lost(at.activity));
        }
        let under = self.log.under.as_ref().map(|under| under.piece.activity);
        match under {
            Some(Activity::Drive(goal)) if lost.contains(&goal) => {
                self.break_off(ctx, Reason::Revoked)
            }
            _ => Ok(()),
        }
    }
}

/// The goal that an activity is for.
pub(super) fn goal_of(activity: Activity) -> Option<GoalKey> {
    match activity {
        Activity::Goal(goal) | Activity::Drive(goal) => Some(goal),
        Activity::Communication(_) | Activity::Sleep => None,
    }
}
