//! What was planned ahead for a timeline, beside the cycles: which token comes next, by how the one
//! before it ends.

use smallvec::SmallVec;

use crate::Ticks;
use crate::database::{Cause, Conflict, Database, Slot, Time, TokenId, Wanted};
use crate::model::{Model, PredicateId, TimelineId, Value};
use crate::parameters::Operand;
use crate::search::Flaw;

/// The output, by its place among the parameters, and its value that a branch asks for, if it asks
/// for any; and the step that follows.
pub type Branch = (Option<(usize, Value)>, usize);

/// A token of a plan that was made ahead.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Following {
    /// What it says.
    pub predicate: PredicateId,
    /// By parameter: its value; none for an output.
    pub parameters: SmallVec<[Option<Value>; 4]>,
    /// It does not start before this tick.
    pub not_before: Ticks,
    /// What follows it: the first branch that holds.
    pub branches: SmallVec<[Branch; 2]>,
}

/// Where a plan is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    /// This step comes next.
    Before(usize),
    /// This step is the token.
    At(usize, TokenId),
}

#[derive(Clone, Debug)]
struct Followed {
    steps: Vec<Following>,
    place: Place,
}

/// What a cycle decided for a timeline that has a plan.
#[derive(Clone, Copy, Debug)]
struct Answer {
    /// How deep the database was when it was decided: if less is left, it was undone.
    depth: usize,
    timeline: TimelineId,
    /// The step that was started, and its token; none, if the default goes on.
    started: Option<(usize, TokenId)>,
}

/// By timeline: what was planned ahead.
#[derive(Clone, Debug, Default)]
pub(super) struct Ahead {
    plans: Vec<Option<Followed>>,
    /// How many plans there are.
    count: usize,
    answers: Vec<Answer>,
    /// The timelines of this cycle's goals and cancels, which win over a plan.
    barred: Vec<TimelineId>,
}

impl Ahead {
    pub(super) fn of(model: &Model) -> Self {
        Ahead {
            plans: vec![None; model.timelines.len()],
            ..Ahead::default()
        }
    }

    /// Takes a plan in place of what was left of the one before.
    pub(super) fn set(&mut self, timeline: TimelineId, steps: Vec<Following>) {
        self.drop(timeline);
        if !steps.is_empty() {
            let place = Place::Before(0);
            self.plans[timeline] = Some(Followed { steps, place });
            self.count += 1;
        }
    }

    pub(super) fn drop(&mut self, timeline: TimelineId) {
        self.count -= usize::from(self.plans[timeline].take().is_some());
    }

    /// The step that comes next on a timeline, if its branch holds.
    fn following(&self, database: &Database, timeline: TimelineId) -> Option<usize> {
        let plan = self.plans[timeline].as_ref()?;
        let (step, token) = match plan.place {
            Place::Before(step) => return Some(step),
            Place::At(step, token) => (step, token),
        };
        let parameters = &database.token(token)?.parameters;
        let holds = |when: Option<(usize, Value)>| {
            when.is_none_or(|(output, value)| database.value(parameters[output]) == Some(value))
        };
        let branches = &plan.steps[step].branches;
        let branch = branches.iter().find(|&&(when, _)| holds(when));
        branch.map(|&(_, next)| next)
    }

    /// The step that starts now on a timeline whose token is over, if its time has come.
    pub(super) fn next(
        &self,
        database: &Database,
        timeline: TimelineId,
        tick: Ticks,
    ) -> Option<u32> {
        if self.count == 0 {
            return None;
        }
        if self.barred.contains(&timeline) {
            return None;
        }
        let next = self.following(database, timeline)?;
        let steps = &self.plans[timeline].as_ref()?.steps;
        (steps[next].not_before <= tick).then_some(next as u32)
    }

    /// A timeline that says its default until the next step's time comes, which it has.
    pub(super) fn waiting(&self, database: &Database, tick: Ticks) -> Option<Flaw> {
        if self.count == 0 {
            return None;
        }
        for (timeline, plan) in self.plans.iter().enumerate() {
            let Some(Followed {
                steps,
                place: Place::Before(next),
            }) = plan
            else {
                continue;
            };
            let after = database.last(timeline)?;
            let fills = says_default(database, timeline, after);
            let answered = self.answers.iter().any(|at| at.timeline == timeline);
            if !answered
                && !self.barred.contains(&timeline)
                && fills
                && steps[*next].not_before <= tick
                && database.start(after).max < tick
                && database.finish(after).contains(tick)
            {
                let after = Some(after);
                return Some(Flaw::Gap { timeline, after });
            }
        }
        None
    }

    /// A step of a timeline's plan starts now.
    pub(super) fn start(
        &mut self,
        database: &mut Database,
        slot: Slot,
        step: u32,
        tick: Ticks,
    ) -> Result<(), Conflict> {
        let step = step as usize;
        let Some(plan) = &self.plans[slot.timeline] else {
            return Ok(());
        };
        let following = &plan.steps[step];
        let parameters = following.parameters.iter();
        let parameters: SmallVec<[Option<Operand>; 4]> =
            parameters.map(|value| value.map(Operand::Value)).collect();
        let predicate = following.predicate;
        let token = database.attempt(|database| {
            let token = database.insert(Wanted {
                predicate,
                timeline: Some(slot.timeline),
                parameters: &parameters,
                start: Some(Time::At(tick)),
                finish: None,
                cause: Cause::User,
            })?;
            database.activate(token, slot)?;
            Ok(token)
        })?;
        self.answers.push(Answer {
            depth: database.depth(),
            timeline: slot.timeline,
            started: Some((step, token)),
        });
        Ok(())
    }

    /// A timeline's default goes on in this cycle.
    pub(super) fn decline(&mut self, database: &Database, timeline: TimelineId) {
        self.answers.push(Answer {
            depth: database.depth(),
            timeline,
            started: None,
        });
    }

    /// What was decided deeper in the database was undone.
    pub(super) fn undone(&mut self, database: &Database) {
        self.answers.retain(|at| at.depth <= database.depth());
    }

    /// A cycle begins.
    pub(super) fn begin(&mut self) {
        self.answers.clear();
        self.barred.clear();
    }

    /// A goal comes to a timeline in this cycle, or is taken back.
    pub(super) fn bar(&mut self, timeline: TimelineId) {
        self.barred.push(timeline);
    }

    /// A cycle was decided: plans go on, or are over where a timeline says something else.
    pub(super) fn decided(&mut self, database: &Database, tick: Ticks) {
        for timeline in 0..self.plans.len() * usize::from(self.count > 0) {
            if self.barred.contains(&timeline) {
                self.drop(timeline);
            }
            let Some(plan) = &self.plans[timeline] else {
                continue;
            };
            let answer = self.answers.iter().find(|at| at.timeline == timeline);
            let started = answer.and_then(|at| at.started);
            let last = database.last(timeline);
            let place = match (last, started) {
                (Some(last), Some((step, token))) if last == token => Some(Place::At(step, token)),
                (Some(last), _) if database.start(last) == crate::temporal::Span::exactly(tick) => {
                    let fills = says_default(database, timeline, last);
                    let next = self.following(database, timeline).filter(|_| fills);
                    next.map(Place::Before)
                }
                _ => Some(plan.place),
            };
            match (place, &mut self.plans[timeline]) {
                (Some(place), Some(plan)) => plan.place = place,
                _ => self.drop(timeline),
            }
        }
    }
}

/// Whether a token is a timeline's default, that nobody asked for.
fn says_default(database: &Database, timeline: TimelineId, token: TokenId) -> bool {
    let default = &database.model().timelines[timeline].default;
    let Some((default, at)) = default.as_ref().zip(database.token(token)) else {
        return false;
    };
    at.supports == 0 && at.predicate == default.predicate && at.cause != Cause::User
}
