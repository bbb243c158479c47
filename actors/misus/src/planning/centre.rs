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
use crate::planner::rounds::by_goal;

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
    /// Whether its last word is said: which goals for two rovers both have planned.
    settled: bool,
}

/// What the centre looked at in a round.
#[derive(Clone, Copy, Debug, Default)]
struct Work {
    reassigned: u32,
    operations: u64,
    /// Whether it was the last round.
    settles: bool,
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
            settled: false,
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
                start_ms: instance.is_joint(node.visit.task).then_some(node.start_ms),
            }));
        }
        for reserved in self.plans.iter().flatten() {
            self.assignments[reserved.goal as usize] = 1;
        }
        Ok(found.operations)
    }

    fn count(&mut self, assignment: &Assignment) {
        self.assignments[assignment.goal] += 1;
    }

    /// Assigns what was shed to others; if nothing was, what waits in the pool to whoever is nearest.
    fn revise(&mut self, instance: &Instance, steps: u32) -> Work {
        let before = self.central.operations();
        let shed = self.said.iter().enumerate();
        let shed = shed.flat_map(|(rover, said)| said.shed.iter().map(move |one| (rover, one)));
        let is_news = |(rover, one): &(usize, &Assigned)| {
            one.assignment == self.assignments[one.goal as usize]
                && self.has(*rover, one.goal as usize)
        };
        let shed = shed.filter(is_news);
        let shed: Vec<(usize, usize)> = shed.map(|(at, one)| (one.goal as usize, at)).collect();
        let mut assigned = Vec::new();
        for (goal, rovers) in by_goal(&shed) {
            assigned.extend(self.central.shed_by(instance, goal, &rovers));
        }
        // Who keeps to the centre's plan has no use for what it left out.
        let rovers_choose = self.plans.iter().all(Vec::is_empty);
        if shed.is_empty() && rovers_choose {
            assigned.extend(self.central.offer_pool(instance));
        }
        for assignment in &assigned {
            self.count(assignment);
        }
        Work {
            reassigned: assigned.len() as u32,
            operations: self.central.operations() - before,
            settles: self.is_over(steps),
        }
    }

    /// Whether all have said that they made so many steps.
    fn is_over(&self, steps: u32) -> bool {
        self.said.iter().all(|said| said.steps >= steps)
    }

    /// Whether a goal is assigned to a rover.
    fn has(&self, rover: usize, goal: usize) -> bool {
        let plan = &self.plans[rover];
        plan.iter().any(|one| one.goal as usize == goal)
            || matches!(self.central.state(goal), State::Assigned(at) if at.rovers.contains(&rover))
    }

    /// When a goal that is assigned to a rover is to begin, if that is agreed on.
    fn start_ms(&self, rover: usize, goal: usize) -> Option<i64> {
        let mut plan = self.plans[rover].iter();
        match plan.find(|one| one.goal as usize == goal) {
            Some(reserved) => reserved.start_ms,
            None => match self.central.state(goal) {
                State::Assigned(assignment) => assignment.start_ms,
                _ => None,
            },
        }
    }

    /// Whether as many rovers have planned a goal, as it was assigned last, as it needs.
    fn is_whole(&self, instance: &Instance, goal: usize) -> bool {
        let assignment = self.assignments[goal];
        let has = |half: &Assigned| half.goal as usize == goal && half.assignment == assignment;
        let halves = self.said.iter().filter(|said| said.halves.iter().any(has));
        halves.count() >= instance.task(goal).rovers as usize
    }

    /// All that a rover may plan now; after the last round, all that it may carry out.
    fn assigned_to(&self, instance: &Instance, rover: usize) -> GoalsAssigned {
        let goals = (0..self.assignments.len()).filter(|&goal| {
            self.has(rover, goal)
                && (!self.settled || !instance.is_joint(goal) || self.is_whole(instance, goal))
        });
        let goals = goals.map(|goal| Assigned {
            goal: goal as u32,
            assignment: self.assignments[goal],
            start_ms: self.start_ms(rover, goal),
        });
        GoalsAssigned {
            round: self.round,
            goals: goals.collect(),
            plan: self.plans[rover].clone(),
            settled: self.settled,
        }
    }

    /// The goals that nobody is to plan now.
    fn pooled(&self) -> Vec<u32> {
        let goals = 0..self.assignments.len();
        let pooled = goals.filter(|&goal| {
            *self.central.state(goal) == State::Pooled
                && !(0..self.said.len()).any(|rover| self.has(rover, goal))
        });
        pooled.map(|goal| goal as u32).collect()
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
            let work = memory.revise(&self.shared.instance, self.shared.planner.steps);
            self.compute(work, ctx);
        }
    }

    /// Looks around again after `delay`, unless all have made all steps and what two rovers do is settled.
    fn look_later(&self, delay: SimDuration, ctx: &mut Context<'_, Self>) {
        let Some(memory) = &self.memory else { return };
        let is_open = self.shared.instance.has_joint() && !memory.settled;
        if is_open || !memory.is_over(self.shared.planner.steps) {
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
            ctx.send(recipient, memory.assigned_to(&self.shared.instance, rover));
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
        let work = Work {
            operations,
            ..Work::default()
        };
        self.compute(work, ctx);
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
            // Who asks has made all steps, and waits for the last word.
            return match asks && memory.settled {
                true => self.assign_to(from, ctx),
                false => Ok(()),
            };
        }
        let (round, is_settled) = (memory.round, memory.settled);
        let all_said = memory.said.iter().all(|said| said.steps >= round);
        if asks && is_known {
            self.assign_to(from, ctx)?;
        }
        if round > 0 && all_said && !is_settled {
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
        memory.settled |= work.settles;
        let sample = CentralRound {
            round: memory.round,
            reassigned: work.reassigned,
            operations: work.operations,
            deleted: memory.deleted(),
            pooled: memory.pooled(),
            assignments: memory.assignments.clone(),
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
                start_ms: None,
            }];
            memory.revise(&instance, 20);
        }
        assert_eq!(owner(&memory), None);
        assert_eq!(memory.revise(&instance, 20).reassigned, 1);
        let back = owner(&memory);
        assert!(back.is_some());
        assert_eq!(memory.revise(&instance, 20).reassigned, 0);
        assert_eq!((owner(&memory), memory.assignments[0]), (back, 4));
    }
}
