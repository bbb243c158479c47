//! Plans from beside the cycles: which step comes next.

use farside_planning::Ticks;
use farside_planning::model::{TimelineId, Value};
use smallvec::SmallVec;

use super::super::Tables;
use super::super::state::{At, Clash, Token};
use super::{Flaw, World};
use crate::service::Step;

/// Where a plan is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::service) enum Place {
    Before(usize),
    /// The step is this token.
    At(usize, Token),
}

/// What was planned ahead for a timeline.
#[derive(Clone, Debug)]
pub(in crate::service) struct Followed {
    pub(in crate::service) steps: std::sync::Arc<[Step]>,
    pub(in crate::service) place: Place,
}

impl World {
    /// A cycle was decided: plans go on, or are over where a timeline says something else.
    pub(in crate::service) fn plans_go_on(&mut self, tick: Ticks, posted: &[TimelineId]) {
        for timeline in 0..self.plans.len() {
            if posted.contains(&timeline) {
                self.plans[timeline] = None;
            }
            let (Some(plan), Some(last)) = (&self.plans[timeline], self.state.last(timeline))
            else {
                continue;
            };
            let At { start, fills, .. } = *self.state.at(last);
            let place = match plan.place {
                Place::At(_, token) if token == last => continue,
                _ if start == tick => {
                    let next = self.following(timeline).filter(|_| fills);
                    next.map(Place::Before)
                }
                place => Some(place),
            };
            match (place, &mut self.plans[timeline]) {
                (Some(place), Some(plan)) => plan.place = place,
                _ => self.plans[timeline] = None,
            }
        }
    }

    /// The step of a timeline's plan that comes next, if its branch holds.
    pub(in crate::service) fn following(&self, timeline: TimelineId) -> Option<usize> {
        let plan = self.plans[timeline].as_ref()?;
        let (step, token) = match plan.place {
            Place::Before(step) => return Some(step),
            Place::At(step, token) => (step, token),
        };
        let parameters = &self.state.at(token).parameters;
        let mut branches = plan.steps[step].branches.iter();
        let branch = branches.find(|branch| {
            branch
                .when
                .is_none_or(|(place, value)| self.state.value(parameters[place]) == Some(value))
        });
        branch.map(|branch| branch.next)
    }

    pub(super) fn next_step(&self, timeline: TimelineId, tick: Ticks) -> Option<usize> {
        if self.barred.contains(&timeline) {
            return None;
        }
        let next = self.following(timeline)?;
        let steps = &self.plans[timeline].as_ref()?.steps;
        (steps[next].not_before <= tick).then_some(next)
    }

    pub(super) fn follow(
        &mut self,
        tables: &Tables,
        timeline: TimelineId,
        step: usize,
        tick: Ticks,
    ) -> Result<(), Clash> {
        if let Some(last) = self.state.last(timeline)
            && self.is_over(timeline, tick)
            && self.close(tables, last, tick)?
        {
            return Ok(());
        }
        self.make_room(tables, timeline, tick)?;
        let Some(plan) = &self.plans[timeline] else {
            return Ok(());
        };
        let at = plan.steps[step].clone();
        let values: SmallVec<[Option<Value>; 6]> = at.inputs.iter().copied().map(Some).collect();
        let token = self.put(tables, timeline, at.predicate, &values, tick);
        if let Some(plan) = &mut self.plans[timeline] {
            plan.place = Place::At(step, token);
        }
        Ok(())
    }

    /// A timeline that says its default though the next step's time has come.
    pub(in crate::service) fn waiting(&self, tick: Ticks) -> Option<Flaw> {
        for (timeline, plan) in self.plans.iter().enumerate() {
            let Some(Followed {
                steps,
                place: Place::Before(next),
            }) = plan
            else {
                continue;
            };
            let last = self.state.last(timeline)?;
            let (min, max) = self.state.finish(last);
            let At { start, fills, .. } = *self.state.at(last);
            if fills
                && !self.barred.contains(&timeline)
                && steps[*next].not_before <= tick
                && start < tick
                && (min..=max).contains(&tick)
            {
                return Some(Flaw::Ahead(timeline));
            }
        }
        None
    }
}
