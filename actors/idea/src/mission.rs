//! The mission agent's deliberation as its plan runner sees it: which goals the ground has asked for,
//! which are done or given up, and which of the others come next.
//!
//! It learns all of that from tokens: requests and recalls on the Ground timeline, and how goals on the
//! Goal timeline end. Where the rover is it knows from the goals that were done: what the rover
//! measures does not come so far up.

#[cfg(test)]
mod tests;

use farside_planning::model::{PredicateId, TimelineId, Value};

use crate::deliberate::{Begin, Settings, Target, deliberate};
use crate::deliberator::{Deliberator, GivenUp, Late, Work};
use crate::models::Mission;
use crate::register::ContractKey;
use crate::service::{Ended, Snapshot, Started};

/// A goal that the ground has asked for.
#[derive(Clone, Debug)]
struct Wanted {
    target: Target,
    attempts: u32,
    is_settled: bool,
}

/// What orders a mission agent's goals.
pub struct MissionPlanner {
    mission: Mission,
    settings: Settings,
    /// After so many attempts a goal is given up.
    attempts: u32,
    wanted: Vec<Wanted>,
    /// Where the rover is, as far as goals say \[dm\].
    at_dm: [Value; 2],
    /// How many plans there were.
    plans: Value,
    given_up: Vec<GivenUp>,
    /// The contract of the Goal register that was loaded last.
    loaded: ContractKey,
    /// The inputs of the goal that is being done, and its contract.
    doing: Option<(ContractKey, Vec<Value>)>,
    /// Those of a goal that was being done when a former life of the agent ended, until it is known
    /// what came of it.
    unresolved: Option<(ContractKey, Vec<Value>)>,
    /// Whether what is left of the plan is not wanted any more.
    drops: bool,
}

/// What the battery is thought to hold \[thousandths of a percent\]: nobody tells the mission agent.
const BATTERY: Value = 90_000;

impl MissionPlanner {
    /// A planner that knows no goal, for a rover that starts at a place \[dm\].
    pub fn new(mission: Mission, settings: Settings, attempts: u32, at_dm: [Value; 2]) -> Self {
        MissionPlanner {
            mission,
            settings,
            attempts,
            wanted: Vec::new(),
            at_dm,
            plans: 0,
            given_up: Vec::new(),
            loaded: (0, 0),
            doing: None,
            unresolved: None,
            drops: false,
        }
    }

    /// The goal of a request: all of its inputs.
    fn want(&mut self, inputs: &[Value]) {
        let [number, x_dm, y_dm, pan_deg, tilt_deg, camera, weight] = *inputs else {
            return;
        };
        let target = Target {
            number,
            x_dm,
            y_dm,
            pan_deg,
            tilt_deg,
            camera,
            weight: u32::try_from(weight).ok().filter(|weight| *weight > 0),
        };
        match self
            .wanted
            .iter_mut()
            .find(|one| one.target.number == number)
        {
            Some(known) => known.target = target,
            None => self.wanted.push(Wanted {
                target,
                attempts: 0,
                is_settled: false,
            }),
        }
    }

    /// The goal that a token of the Goal timeline is for, among those that are not settled.
    fn of_inputs(&mut self, inputs: &[Value]) -> Option<&mut Wanted> {
        let [x_dm, y_dm, pan_deg, tilt_deg, camera] = *inputs else {
            return None;
        };
        self.wanted.iter_mut().find(|one| {
            let target = &one.target;
            let known = [target.x_dm, target.y_dm, target.pan_deg, target.tilt_deg];
            !one.is_settled && known == [x_dm, y_dm, pan_deg, tilt_deg] && target.camera == camera
        })
    }

    /// A goal has ended with a status.
    fn goal_ended(&mut self, inputs: &[Value], status: Option<Value>) {
        let most = self.attempts;
        let (ok, preempted) = (self.mission.statuses.ok, self.mission.statuses.preempted);
        let symbols = &self.mission.model.symbols;
        let name = status.and_then(|at| symbols.get(usize::try_from(at).ok()?));
        let name = name.cloned().unwrap_or_else(|| "nothing".to_owned());
        let Some(goal) = self.of_inputs(inputs) else {
            return;
        };
        let number = goal.target.number;
        if status == Some(ok) {
            goal.is_settled = true;
            self.at_dm = [inputs[0], inputs[1]];
        } else if status != Some(preempted) {
            goal.attempts += 1;
            if goal.attempts >= most {
                goal.is_settled = true;
                let reason = format!("{most} attempts, the last ended with {name}");
                self.given_up.push(GivenUp {
                    goal: number,
                    reason,
                });
            }
        }
    }
}

/// The values of a token's inputs.
fn inputs(parameters: &[Option<Value>], count: usize) -> Vec<Value> {
    parameters
        .iter()
        .take(count)
        .map_while(|value| *value)
        .collect()
}

impl Deliberator for MissionPlanner {
    fn timeline(&self) -> TimelineId {
        self.mission.timelines.planner
    }

    fn asked(&mut self, predicate: PredicateId, inputs: &[Value]) {
        if predicate != self.mission.predicates.recall {
            return;
        }
        let mut wanted = self.wanted.iter_mut();
        if let Some(goal) = wanted.find(|one| Some(&one.target.number) == inputs.first()) {
            goal.is_settled = true;
            self.drops = true;
        }
    }

    fn begun(&mut self, token: &Started) {
        let predicates = &self.mission.predicates;
        let count = self.mission.model.predicates[token.predicate].inputs;
        if token.predicate == predicates.image_at {
            self.doing = Some((self.loaded, inputs(&token.parameters, count)));
        } else if token.predicate == predicates.request {
            self.want(&inputs(&token.parameters, count));
        }
    }

    fn ended(&mut self, token: &Ended) {
        if token.predicate == self.mission.predicates.image_at {
            let count = self.mission.model.predicates[token.predicate].inputs;
            let status = token.parameters.get(count).copied().flatten();
            self.doing = None;
            self.goal_ended(&inputs(&token.parameters, count), status);
        }
    }

    fn restarted(&mut self) {
        self.unresolved = self.doing.take().or(self.unresolved.take());
    }

    fn loaded(&mut self, timeline: TimelineId, contract: ContractKey) {
        if timeline == self.mission.timelines.goal {
            self.loaded = contract;
        }
    }

    fn unresolved(&self) -> Option<(TimelineId, ContractKey)> {
        let (contract, _) = self.unresolved.as_ref()?;
        Some((self.mission.timelines.goal, *contract))
    }

    fn late(&mut self, timeline: TimelineId, contract: ContractKey, end: Late<'_>) {
        if timeline != self.mission.timelines.goal {
            return;
        }
        let resolved = self.unresolved.take_if(|(known, _)| *known == contract);
        let Some((_, inputs)) = resolved else {
            return;
        };
        let status = match end {
            // That was no attempt.
            Late::NeverBegun => return,
            Late::Faulted => None,
            Late::Ended(status) => Some(status),
        };
        let symbols = &self.mission.model.symbols;
        let at = symbols
            .iter()
            .position(|name| Some(name.as_str()) == status);
        self.goal_ended(&inputs, at.map(|at| at as Value));
    }

    fn gives_up(&mut self) -> Vec<GivenUp> {
        std::mem::take(&mut self.given_up)
    }

    fn drops(&mut self) -> Option<TimelineId> {
        std::mem::take(&mut self.drops).then_some(self.mission.timelines.goal)
    }

    fn work(&mut self, token: &Started, snapshot: &Snapshot) -> Option<Work> {
        if token.predicate != self.mission.predicates.planning {
            return None;
        }
        let goal = self.mission.timelines.goal;
        if self.unresolved.is_some() {
            // What came of the last goal the other side will say: then all is planned anew.
            return Some(Work {
                operations: 1,
                outputs: vec![Some(self.mission.planned.stale), None],
                plan: None,
                reads: Vec::new(),
                remarks: Vec::new(),
            });
        }
        let [h0, ..] = inputs(&token.parameters, 2)[..] else {
            return None;
        };
        // What is being done goes on: the plan begins where it ends.
        let present = snapshot.present[goal].as_ref();
        let present = present.filter(|one| one.predicate == self.mission.predicates.image_at);
        let doing = present.map(|one| inputs(&one.parameters, one.parameters.len() - 1));
        let doing = doing.and_then(|inputs| self.of_inputs(&inputs).map(|one| one.target));
        let [x_dm, y_dm] = doing.map_or(self.at_dm, |target| [target.x_dm, target.y_dm]);
        let left = self.wanted.iter().filter(|one| !one.is_settled);
        let left = left.map(|one| one.target);
        let left: Vec<Target> = left.filter(|target| Some(*target) != doing).collect();
        self.plans += 1;
        let begin = Begin {
            x_dm,
            y_dm,
            battery: BATTERY,
        };
        let statuses = &self.mission.planned;
        match deliberate(&self.mission, &left, &begin, h0, &self.settings) {
            Ok(found) => {
                let remarks = found.ordering.left_out.iter().map(|out| {
                    let number = left[out.target].number;
                    format!("goal {number} is left out: {}", out.reason)
                });
                let status = match found.plan {
                    Some(_) => statuses.planned,
                    None => statuses.nothing_to_do,
                };
                Some(Work {
                    operations: found.operations,
                    outputs: vec![Some(status), Some(self.plans)],
                    remarks: remarks.collect(),
                    plan: found.plan,
                    reads: vec![goal],
                })
            }
            Err(error) => Some(Work {
                operations: 1,
                outputs: vec![Some(statuses.nothing_to_do), Some(self.plans)],
                plan: None,
                reads: vec![goal],
                remarks: vec![format!("goals cannot be ordered: {error}")],
            }),
        }
    }
}
