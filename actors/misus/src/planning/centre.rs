//! The central planner as an actor.

use std::sync::Arc;

use farside::prelude::*;
use farside_actors::processor::{Processor, ProcessorChange};

use super::messages::{
    Assigned, AssignmentsLeave, CentralRound, GoalsAssigned, LooksAround, PlanHeld, Reserved,
};
use super::shared::Shared;
use crate::planner::casper::{Choice, PlannerConfig};
use crate::planner::central::{Assignment, Central, State};
use crate::planner::instance::Instance;
use crate::planner::lns;

/// What the centre knows. It outlives crashes as it was when goals had been assigned last.
#[derive(Clone)]
struct Memory {
    central: Central,
    /// How often goals have been assigned.
    round: u32,
    /// By goal: how many times it has been assigned.
    assignments: Vec<u32>,
    /// By rover: what it said last.
    said: Vec<PlanHeld>,
    /// By rover: the plan that it begins with, where the centre plans for the team.
    plans: Vec<Vec<Reserved>>,
}

/// What the centre looked at in a round.
#[derive(Clone, Copy, Debug, Default)]
struct Work {
    reassigned: u32,
    operations: u64,
}

/// The central planner.
pub(super) struct CentralPlanner {
    shared: Arc<Shared>,
    processor: Processor,
    /// There from the start on.
    memory: Option<Memory>,
    /// What the processor has in hand.
    in_hand: Option<Work>,
    /// How often goals had been assigned when it last looked around.
    looked: u32,
}

/// What is kept through crashes.
#[derive(Default)]
struct Kept(Option<Memory>);

impl Memory {
    /// Nothing is assigned yet.
    fn new(instance: &Instance, planner: &PlannerConfig) -> Memory {
        let rovers = instance.vehicles().len();
        Memory {
            central: Central::new(instance, planner),
            round: 0,
            assignments: vec![0; instance.goals()],
            said: vec![PlanHeld::default(); rovers],
            plans: vec![Vec::new(); rovers],
        }
    }

    /// Assigns all goals for the first time. Returns what was looked at.
    fn begin(&mut self, shared: &Shared) -> Result<u64, HandlerError> {
        let instance = &shared.instance;
        if shared.planner.choice != Choice::Lns {
            let before = self.central.operations();
            for assignment in self.central.assign_all(instance) {
                self.count(&assignment);
            }
            return Ok(self.central.operations() - before);
        }
        let found = lns::plan(instance, &shared.lns, shared.key);
        let found = found.map_err(|unmet| HandlerError::new(unmet.to_string()))?;
        for (plan, chain) in self.plans.iter_mut().zip(&found.chains) {
            let goals = chain.nodes().iter();
            let goals = goals.filter(|node| node.visit.task < instance.goals());
            plan.extend(goals.map(|node| Reserved {
                goal: node.visit.task as u32,
                sol: node.sol as u32,
            }));
        }
        Ok(found.operations)
    }

    fn count(&mut self, assignment: &Assignment) {
        self.assignments[assignment.goal] += 1;
    }

    /// Assigns what was shed to others; if nothing was, what waits in the pool to whoever is nearest.
    fn revise(&mut self, instance: &Instance) -> Work {
        let before = self.central.operations();
        let shed = self.said.iter().enumerate();
        let shed = shed.flat_map(|(rover, said)| said.shed.iter().map(move |one| (rover, *one)));
        let shed: Vec<(usize, Assigned)> = shed.collect();
        let (mut is_news, mut assigned) = (false, Vec::new());
        for (rover, one) in shed {
            let goal = one.goal as usize;
            let has = matches!(self.central.state(goal), State::Assigned(at) if at.rovers.contains(&rover));
            if !has || one.assignment != self.assignments[goal] {
                continue;
            }
            is_news = true;
            assigned.extend(self.central.shed(instance, goal, rover));
        }
        if !is_news {
            assigned.extend(self.central.offer_pool(instance));
        }
        for assignment in &assigned {
            self.count(assignment);
        }
        Work {
            reassigned: assigned.len() as u32,
            operations: self.central.operations() - before,
        }
    }

    /// All that a rover may plan now.
    fn assigned_to(&self, rover: usize) -> GoalsAssigned {
        let plan = self.plans[rover].clone();
        let mut reserved: Vec<u32> = plan.iter().map(|one| one.goal).collect();
        reserved.sort_unstable();
        let has = |goal: &usize| matches!(self.central.state(*goal), State::Assigned(at) if at.rovers.contains(&rover));
        let goals = (0..self.assignments.len()).filter(has);
        let goals = goals.map(|goal| Assigned {
            goal: goal as u32,
            assignment: self.assignments[goal],
        });
        let reserved = reserved.into_iter().map(|goal| Assigned {
            goal,
            assignment: 1,
        });
        GoalsAssigned {
            round: self.round,
            goals: goals.chain(reserved).collect(),
            plan,
        }
    }

    fn deleted(&self) -> Vec<u32> {
        let deleted = self.central.deleted();
        deleted.map(|(goal, _)| goal as u32).collect()
    }
}

impl CentralPlanner {
    pub(super) fn new(shared: Arc<Shared>, processor: Processor) -> CentralPlanner {
        CentralPlanner {
            shared,
            processor,
            memory: None,
            in_hand: None,
            looked: 0,
        }
    }

    fn compute(&mut self, work: Work, ctx: &mut Context<'_, Self>) {
        let takes = self.processor.time_for(ctx.now(), work.operations);
        self.in_hand = Some(work);
        ctx.timer(takes, AssignmentsLeave);
    }

    fn revise(&mut self, ctx: &mut Context<'_, Self>) {
        if let (Some(memory), None) = (&mut self.memory, self.in_hand) {
            let work = memory.revise(&self.shared.instance);
            self.compute(work, ctx);
        }
    }

    /// Looks around again after `delay`, unless all have made all steps.
    fn look_later(&self, delay: SimDuration, ctx: &mut Context<'_, Self>) {
        let Some(memory) = &self.memory else { return };
        let done = |said: &PlanHeld| said.steps >= self.shared.planner.steps;
        if !memory.said.iter().all(done) {
            ctx.timer(delay, LooksAround);
        }
    }

    /// Assigns again what rovers may not have heard of, if nothing has come of it since the last look.
    fn repeat(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        let Some(memory) = &self.memory else {
            return Ok(());
        };
        if std::mem::replace(&mut self.looked, memory.round) < memory.round {
            return Ok(());
        }
        let behind = |rover: &usize| memory.said[*rover].steps < memory.round;
        let behind: Vec<usize> = (0..memory.said.len()).filter(behind).collect();
        let mut behind = behind.into_iter();
        behind.try_for_each(|rover| self.assign_to(rover, ctx))
    }

    fn assign_to(&self, rover: usize, ctx: &mut Context<'_, Self>) -> Outcome {
        if let Some(memory) = &self.memory {
            let recipient = ctx.recipient::<GoalsAssigned>(&self.shared.rovers[rover])?;
            ctx.send(recipient, memory.assigned_to(rover));
        }
        Ok(())
    }
}

impl Actor for CentralPlanner {
    type Accepts = (PlanHeld, LooksAround, AssignmentsLeave, ProcessorChange);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        let every = self.shared.rounds.every;
        if let Some(memory) = ctx.durable::<Kept>().0.clone() {
            self.memory = Some(memory);
            self.look_later(every, ctx);
            return Ok(());
        }
        let mut memory = Memory::new(&self.shared.instance, &self.shared.planner);
        let operations = memory.begin(&self.shared)?;
        self.memory = Some(memory);
        let reassigned = 0;
        self.compute(
            Work {
                reassigned,
                operations,
            },
            ctx,
        );
        // Between the steps of rovers that begin together.
        self.look_later(SimDuration::from_nanos(every.as_nanos() / 2), ctx);
        Ok(())
    }
}

impl Handler<PlanHeld> for CentralPlanner {
    fn handle(&mut self, message: PlanHeld, ctx: &mut Context<'_, Self>) -> Outcome {
        let Some(memory) = &mut self.memory else {
            return Ok(());
        };
        let (from, is_known) = (message.rover as usize, memory.round > message.steps);
        let asks = message.asks;
        if memory.said[from].steps < message.steps {
            memory.said[from] = message;
        }
        if !self.shared.rounds.synchronised {
            return Ok(());
        }
        let round = memory.round;
        let all_said = memory.said.iter().all(|said| said.steps >= round);
        if asks && is_known {
            self.assign_to(from, ctx)?;
        }
        if round > 0 && all_said {
            self.revise(ctx);
        }
        Ok(())
    }
}

impl Handler<LooksAround> for CentralPlanner {
    fn handle(&mut self, _: LooksAround, ctx: &mut Context<'_, Self>) -> Outcome {
        match self.shared.rounds.synchronised {
            true => self.repeat(ctx)?,
            false => self.revise(ctx),
        }
        self.look_later(self.shared.rounds.every, ctx);
        Ok(())
    }
}

impl Handler<AssignmentsLeave> for CentralPlanner {
    fn handle(&mut self, _: AssignmentsLeave, ctx: &mut Context<'_, Self>) -> Outcome {
        let (Some(work), Some(memory)) = (self.in_hand.take(), &mut self.memory) else {
            return Ok(());
        };
        memory.round += 1;
        let sample = CentralRound {
            round: memory.round,
            reassigned: work.reassigned,
            operations: work.operations,
            deleted: memory.deleted(),
        };
        // What is assigned is kept before it is said.
        ctx.durable::<Kept>().0.clone_from(&self.memory);
        ctx.sample(&sample);
        for rover in 0..self.shared.rovers.len() {
            self.assign_to(rover, ctx)?;
        }
        Ok(())
    }
}

impl Handler<ProcessorChange> for CentralPlanner {
    fn handle(&mut self, _: ProcessorChange, _: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::planner::problem::{ProblemConfig, generate};

    /// A goal that all rovers shed comes back to one of them, whose old word is the last that the centre
    /// has heard: that is no news of the goal.
    #[test]
    fn what_was_shed_before_a_goal_came_back_is_no_news() {
        let instance = Instance::new(&generate(&ProblemConfig::default(), 1).unwrap()).unwrap();
        let mut memory = Memory::new(&instance, &PlannerConfig::default());
        for assignment in memory.central.assign_all(&instance) {
            memory.count(&assignment);
        }
        let owner = |memory: &Memory| match memory.central.state(0) {
            State::Assigned(assignment) => Some(assignment.rovers[0]),
            _ => None,
        };
        for time in 1..=3 {
            let rover = owner(&memory).unwrap();
            memory.said[rover].shed = vec![Assigned {
                goal: 0,
                assignment: time,
            }];
            memory.revise(&instance);
        }
        assert_eq!(owner(&memory), None);
        assert_eq!(memory.revise(&instance).reassigned, 1);
        let back = owner(&memory);
        assert!(back.is_some());
        assert_eq!(memory.revise(&instance).reassigned, 0);
        assert_eq!((owner(&memory), memory.assignments[0]), (back, 4));
    }
}
