//! The planner of a rover as an actor.

use std::collections::BTreeSet;
use std::sync::Arc;

use farside::prelude::*;
use farside_actors::processor::{Processor, ProcessorChange};

use super::messages::{
    Assigned, GoalsAssigned, PlanHeld, PlanSettled, PlannedStop, PlannerStep, Reserved, StepBegins,
    StepEnds, StillWaits,
};
use super::shared::{CENTRE, Shared};
use crate::planner::casper::{Casper, Step, Unmet};
use crate::planner::chain::Visit;
use crate::planner::instance::Instance;

/// What a planner knows. It outlives crashes as it was when the last step had been made.
#[derive(Clone)]
struct Memory {
    casper: Casper,
    /// How many steps it has made.
    steps: u32,
    /// When the last one began.
    began: SimTime,
    /// What the centre said last, and which of its rounds is in the planner already.
    assigned: GoalsAssigned,
    taken: u32,
    /// By goal: the number of the assignment that the rover has or had.
    assignments: Vec<u32>,
    /// What was shed, as long as the centre may not know.
    shed: Vec<Assigned>,
    /// How many goals for two rovers left the plan since the last step.
    withdrawn: u32,
    /// By rover: what it said of its last two steps. Those who wait for each other are one step apart at
    /// the most.
    heard: Vec<[PlanHeld; 2]>,
    /// What the planner said of its own last two steps.
    said: [PlanHeld; 2],
}

/// The planner of a rover.
pub(super) struct RoverPlanner {
    shared: Arc<Shared>,
    rover: usize,
    processor: Processor,
    /// There from the start on.
    memory: Option<Memory>,
    /// The step that the processor has in hand.
    in_hand: Option<Step>,
    /// Whether the next step has its time.
    is_due: bool,
}

/// What is kept through crashes.
#[derive(Default)]
struct Kept(Option<Memory>);

impl RoverPlanner {
    pub(super) fn new(shared: Arc<Shared>, rover: usize, processor: Processor) -> RoverPlanner {
        RoverPlanner {
            shared,
            rover,
            processor,
            memory: None,
            in_hand: None,
            is_due: false,
        }
    }

    /// The others, by number.
    fn others(&self) -> impl Iterator<Item = usize> + use<> {
        let rover = self.rover;
        (0..self.shared.rovers.len()).filter(move |other| *other != rover)
    }

    /// Sets the time of the next step, once everything is there that it needs.
    fn go_on(&mut self, ctx: &mut Context<'_, Self>) {
        let rounds = &self.shared.rounds;
        let Some(memory) = &self.memory else { return };
        let is_over = memory.steps >= self.shared.planner.steps;
        let waits = rounds.synchronised && !self.lacks(memory).is_none();
        if is_over || waits || self.is_due || self.in_hand.is_some() {
            return;
        }
        let first = memory.steps == 0 && rounds.synchronised;
        let at = match first {
            true => ctx.now(),
            false => memory.began + rounds.every,
        };
        self.is_due = true;
        ctx.timer(at.since(ctx.now()), StepBegins);
    }

    /// What a planner has not heard yet: one that is synchronised what it needs for the next step, and any
    /// after the last step which goals for two rovers are carried out.
    fn lacks(&self, memory: &Memory) -> Lacking {
        let is_over = memory.steps >= self.shared.planner.steps;
        if !self.shared.rounds.synchronised {
            let is_open = is_over && self.shared.instance.has_joint();
            return Lacking {
                centre: is_open && !memory.assigned.settled,
                rovers: Vec::new(),
            };
        }
        let silent = |other: &usize| {
            let heard = &memory.heard[*other][(memory.steps % 2) as usize];
            memory.steps > 0 && !is_over && heard.steps != memory.steps
        };
        Lacking {
            centre: memory.assigned.round <= memory.steps,
            rovers: self.others().filter(silent).collect(),
        }
    }

    /// Asks for what is still lacking, and says again what others may lack.
    fn ask(&self, ctx: &mut Context<'_, Self>) -> Outcome {
        let Some(memory) = &self.memory else {
            return Ok(());
        };
        let lacking = self.lacks(memory);
        if lacking.is_none() {
            return Ok(());
        }
        let mut said = memory.said[(memory.steps % 2) as usize].clone();
        said.rover = self.rover as u32;
        let others = self.others();
        for other in others.filter(|_| self.shared.rounds.synchronised) {
            let name = &self.shared.rovers[other];
            said.asks = lacking.rovers.contains(&other);
            if said.asks && memory.steps > 1 {
                // Who is a step behind waits for that.
                let before = memory.said[((memory.steps + 1) % 2) as usize].clone();
                self.tell(ctx, name, before)?;
            }
            if memory.steps > 0 {
                self.tell(ctx, name, said.clone())?;
            }
        }
        said.asks = lacking.centre;
        self.tell(ctx, CENTRE, said)?;
        self.wait(ctx);
        Ok(())
    }

    /// Looks again in a while whether everything is there.
    fn wait(&self, ctx: &mut Context<'_, Self>) {
        let Some(memory) = &self.memory else { return };
        if self.shared.rounds.synchronised || self.lacks(memory).centre {
            let steps = memory.steps;
            ctx.timer(self.shared.rounds.every, StillWaits { steps });
        }
    }

    fn tell(&self, ctx: &mut Context<'_, Self>, name: &str, said: PlanHeld) -> Outcome {
        let recipient = ctx.recipient::<PlanHeld>(name)?;
        ctx.send(recipient, said);
        Ok(())
    }

    /// Brings what was heard into the planner. Returns what was looked at.
    fn learn(&mut self) -> Result<u64, HandlerError> {
        let others = self.others();
        let instance = &self.shared.instance;
        let Some(memory) = &mut self.memory else {
            return Ok(0);
        };
        let failed = |unmet: Unmet| HandlerError::new(unmet.to_string());
        let mut operations = 0;
        if memory.taken < memory.assigned.round {
            memory.part(instance).map_err(failed)?;
            for one in &memory.assigned.goals {
                let goal = one.goal as usize;
                if memory.assignments[goal] < one.assignment {
                    memory.assignments[goal] = one.assignment;
                    let assigned = memory.casper.assign(instance, goal, one.start_ms);
                    assigned.map_err(failed)?;
                }
            }
            let goals: BTreeSet<(u32, u32)> = memory.assigned.goals.iter().map(pair).collect();
            memory.shed.retain(|one| goals.contains(&pair(one)));
            if memory.taken == 0 && !memory.assigned.plan.is_empty() {
                let plan = memory.assigned.plan.iter();
                let visit = |at: &Reserved| match at.start_ms {
                    Some(start_ms) => Visit::at(instance, at.goal as usize, start_ms),
                    None => Visit::new(instance, at.goal as usize),
                };
                let plan: Vec<_> = plan.map(|at| (at.sol as usize, visit(at))).collect();
                operations += memory.casper.resume(instance, &plan).map_err(failed)?;
            }
            memory.taken = memory.assigned.round;
        }
        for other in others {
            let [even, odd] = &memory.heard[other];
            let heard = match self.shared.rounds.synchronised {
                true => &memory.heard[other][(memory.steps % 2) as usize],
                false if even.steps > odd.steps => even,
                false => odd,
            };
            let held: Vec<usize> = heard.held.iter().map(|goal| *goal as usize).collect();
            memory.casper.hear(other, &held);
        }
        Ok(operations)
    }

    /// After the last step, once the centre has said its last word: no half of a pair stays in the plan.
    fn settle(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        let instance = &self.shared.instance;
        let is_last = self.shared.planner.steps;
        let Some(memory) = &mut self.memory else {
            return Ok(());
        };
        if !memory.assigned.settled || memory.steps < is_last || !instance.has_joint() {
            return Ok(());
        }
        let parted = memory.part_for_good(instance);
        parted.map_err(|unmet| HandlerError::new(unmet.to_string()))?;
        let plan = memory.casper.plan();
        let sample = PlanSettled {
            withdrawn: std::mem::take(&mut memory.withdrawn),
            traverse_mm: plan.drive_mm(instance),
            plan: plan.nodes().iter().map(PlannedStop::from).collect(),
        };
        ctx.durable::<Kept>().0.clone_from(&self.memory);
        ctx.sample(&sample);
        Ok(())
    }

    /// What the planner says after a step.
    fn conclude(&mut self, step: &Step) -> Option<(PlanHeld, PlannerStep)> {
        let instance = &self.shared.instance;
        let memory = self.memory.as_mut()?;
        memory.steps += 1;
        let shed = step.shed.iter().map(|&goal| Assigned {
            goal: goal as u32,
            assignment: memory.assignments[goal],
            start_ms: None,
        });
        memory.shed.extend(shed);
        let held = memory.casper.held(instance);
        let halves = memory.halves(instance);
        let said = PlanHeld {
            rover: self.rover as u32,
            steps: memory.steps,
            held: held.into_iter().map(|goal| goal as u32).collect(),
            shed: memory.shed.clone(),
            halves,
            asks: false,
        };
        memory.said[(memory.steps % 2) as usize] = said.clone();
        let plan = memory.casper.plan();
        let stops = plan.nodes().iter().map(PlannedStop::from);
        let sample = PlannerStep {
            steps: memory.steps,
            iterations: step.iterations,
            operations: step.operations,
            shed: step.shed.len() as u32,
            unheard: memory.shed.clone(),
            withdrawn: std::mem::take(&mut memory.withdrawn),
            traverse_mm: plan.drive_mm(instance),
            plan: stops.collect(),
        };
        Some((said, sample))
    }
}

fn pair(one: &Assigned) -> (u32, u32) {
    (one.goal, one.assignment)
}

impl Memory {
    /// The goals for two rovers that the plan has.
    fn halves(&self, instance: &Instance) -> Vec<Assigned> {
        let goals = self.casper.plan().goals(instance);
        let mut goals: Vec<usize> = goals.filter(|goal| instance.is_joint(*goal)).collect();
        goals.sort_unstable();
        let half = |goal: usize| Assigned {
            goal: goal as u32,
            assignment: self.assignments[goal],
            start_ms: None,
        };
        goals.into_iter().map(half).collect()
    }

    /// Takes all halves out of the plan that the centre does not name in its last word.
    fn part_for_good(&mut self, instance: &Instance) -> Result<(), Unmet> {
        let named: BTreeSet<(u32, u32)> = self.assigned.goals.iter().map(pair).collect();
        let before = self.halves(instance).len();
        let assignments = &self.assignments;
        let stays = |goal: usize| named.contains(&(goal as u32, assignments[goal]));
        self.casper.part(instance, stays)?;
        self.withdrawn += (before - self.halves(instance).len()) as u32;
        Ok(())
    }

    /// Gives up the goals for two rovers that the centre has withdrawn: nobody waits for who does not come.
    fn part(&mut self, instance: &Instance) -> Result<(), Unmet> {
        let named: BTreeSet<(u32, u32)> = self.assigned.goals.iter().map(pair).collect();
        let joint = self
            .casper
            .assigned()
            .filter(|goal| instance.is_joint(*goal));
        let gone = joint.filter(|&goal| !named.contains(&(goal as u32, self.assignments[goal])));
        for goal in gone.collect::<Vec<usize>>() {
            self.withdrawn += u32::from(self.casper.score().holds(goal));
            self.casper.withdraw(instance, goal)?;
        }
        Ok(())
    }
}

/// Whose word is lacking.
struct Lacking {
    centre: bool,
    rovers: Vec<usize>,
}

impl Lacking {
    fn is_none(&self) -> bool {
        !self.centre && self.rovers.is_empty()
    }
}

impl Actor for RoverPlanner {
    type Accepts = (
        GoalsAssigned,
        PlanHeld,
        StepBegins,
        StepEnds,
        StillWaits,
        ProcessorChange,
    );

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        let shared = &self.shared;
        let memory = match ctx.durable::<Kept>().0.clone() {
            Some(memory) => memory,
            None => Memory {
                casper: Casper::new(&shared.instance, self.rover, &shared.planner, shared.key)
                    .map_err(|unmet| HandlerError::new(unmet.to_string()))?,
                steps: 0,
                began: SimTime::ZERO,
                assigned: GoalsAssigned::default(),
                taken: 0,
                assignments: vec![0; shared.instance.goals()],
                shed: Vec::new(),
                withdrawn: 0,
                heard: vec![Default::default(); shared.rovers.len()],
                said: Default::default(),
            },
        };
        self.memory = Some(memory);
        self.wait(ctx);
        self.go_on(ctx);
        Ok(())
    }
}

impl Handler<GoalsAssigned> for RoverPlanner {
    fn handle(&mut self, message: GoalsAssigned, ctx: &mut Context<'_, Self>) -> Outcome {
        let Some(memory) = &mut self.memory else {
            return Ok(());
        };
        let is_new = message.round > memory.assigned.round;
        if is_new {
            memory.assigned = message;
        }
        let is_over = memory.steps >= self.shared.planner.steps;
        if is_over && !self.shared.rounds.synchronised && !memory.assigned.settled {
            // The centre asks until it has heard the last word of all.
            let said = memory.said[(memory.steps % 2) as usize].clone();
            self.tell(ctx, CENTRE, said)?;
        }
        if is_new {
            self.settle(ctx)?;
        }
        self.go_on(ctx);
        Ok(())
    }
}

impl Handler<PlanHeld> for RoverPlanner {
    fn handle(&mut self, message: PlanHeld, ctx: &mut Context<'_, Self>) -> Outcome {
        let Some(memory) = &mut self.memory else {
            return Ok(());
        };
        let slot = (message.steps % 2) as usize;
        let from = message.rover as usize;
        if message.asks && memory.said[slot].steps == message.steps {
            let said = memory.said[slot].clone();
            self.tell(ctx, &self.shared.rovers[from], said)?;
        }
        if let Some(memory) = &mut self.memory
            && memory.heard[from][slot].steps < message.steps
        {
            memory.heard[from][slot] = message;
        }
        self.go_on(ctx);
        Ok(())
    }
}

impl Handler<StepBegins> for RoverPlanner {
    fn handle(&mut self, _: StepBegins, ctx: &mut Context<'_, Self>) -> Outcome {
        self.is_due = false;
        let operations = self.learn()?;
        let Some(memory) = &mut self.memory else {
            return Ok(());
        };
        memory.began = ctx.now();
        let mut step = memory.casper.step(&self.shared.instance);
        step.operations += operations;
        let takes = self.processor.time_for(ctx.now(), step.operations);
        self.in_hand = Some(step);
        ctx.timer(takes, StepEnds);
        Ok(())
    }
}

impl Handler<StepEnds> for RoverPlanner {
    fn handle(&mut self, _: StepEnds, ctx: &mut Context<'_, Self>) -> Outcome {
        let Some(step) = self.in_hand.take() else {
            return Ok(());
        };
        let Some((said, sample)) = self.conclude(&step) else {
            return Ok(());
        };
        // What is said is kept before it is said.
        ctx.durable::<Kept>().0.clone_from(&self.memory);
        ctx.sample(&sample);
        for other in self.others() {
            self.tell(ctx, &self.shared.rovers[other], said.clone())?;
        }
        self.tell(ctx, CENTRE, said)?;
        self.wait(ctx);
        self.go_on(ctx);
        Ok(())
    }
}

impl Handler<StillWaits> for RoverPlanner {
    fn handle(&mut self, message: StillWaits, ctx: &mut Context<'_, Self>) -> Outcome {
        let steps = self.memory.as_ref().map(|memory| memory.steps);
        match steps == Some(message.steps) && self.in_hand.is_none() {
            true => self.ask(ctx),
            false => Ok(()),
        }
    }
}

impl Handler<ProcessorChange> for RoverPlanner {
    fn handle(&mut self, _: ProcessorChange, _: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}
