//! The paper's evaluation (section 5): planners that are synchronised after each optimisation step, over
//! links that are perfect.
//!
//! In a round every rover has one step, with what the others held after the round before. Then all tell what
//! they hold, and the centre assigns what was shed to others. In a round without sheds the pool is offered
//! again.

use farside::random::RandomKey;

use super::casper::{Casper, PlannerConfig, Unmet};
use super::central::{Assignment, Central, Reason};
use super::chain::Chain;
use super::instance::Instance;
use super::plan::{Stop, TeamPlan};
use super::problem::Problem;
use super::score::Score;

/// What became of a problem, round by round.
#[derive(Clone, Debug, PartialEq)]
pub struct Rounds {
    /// By round: the team's score by Equation 1.
    pub score: Vec<f64>,
    /// By round: how many goals the team's plan achieves.
    pub goals: Vec<f64>,
    /// By round: how many iterations all rovers had in it.
    pub iterations: Vec<f64>,
    /// By round: what all rovers looked at in it.
    pub operations: Vec<f64>,
    /// By round: how far the team drives in all \[m\].
    pub traverse_m: Vec<f64>,
    /// The plan at the end.
    pub plan: TeamPlan,
    /// How often a rover shed a goal.
    pub shed: u64,
    /// How often a goal was assigned to another rover than before, or offered again.
    pub reassigned: u64,
    /// The goals that were given up, and why.
    pub deleted: Vec<(usize, Reason)>,
    /// What the centre looked at.
    pub central_operations: u64,
}

/// Plans a problem in as many rounds as the settings have steps. The draws are at `key`.
///
/// ```
/// use farside::random::RandomKey;
/// use farside_misus::planner::casper::PlannerConfig;
/// use farside_misus::planner::instance::Instance;
/// use farside_misus::planner::plan::{score, violations};
/// use farside_misus::planner::problem::{ProblemConfig, generate};
/// use farside_misus::planner::rounds::run;
/// let problem = generate(&ProblemConfig::default(), 1)?;
/// let instance = Instance::new(&problem)?;
/// let rounds = run(&problem, &instance, &PlannerConfig::default(), RandomKey::new(1))?;
/// assert_eq!(violations(&problem, &rounds.plan), []);
/// assert!((rounds.score[19] - score(&problem, &rounds.plan)).abs() < 1e-9);
/// assert!(rounds.score[19] > rounds.score[0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// When a rover cannot do what it has to.
pub fn run(
    problem: &Problem,
    instance: &Instance,
    config: &PlannerConfig,
    key: RandomKey,
) -> Result<Rounds, Unmet> {
    let mut team = Team::new(instance, config, key)?;
    let first = team.central.assign_all(instance);
    team.deliver(instance, first)?;
    team.refuse_hopeless(instance)?;
    let mut rounds = Rounds {
        score: Vec::new(),
        goals: Vec::new(),
        iterations: Vec::new(),
        operations: Vec::new(),
        traverse_m: Vec::new(),
        plan: TeamPlan::default(),
        shed: 0,
        reassigned: 0,
        deleted: Vec::new(),
        central_operations: 0,
    };
    for step in 1..=config.steps {
        team.round(instance, &mut rounds, step == config.steps)?;
    }
    team.part(instance)?;
    // What goals for two rovers leave behind counts in the last round.
    rounds.score.pop();
    rounds.goals.pop();
    rounds.traverse_m.pop();
    team.enter(instance).push(&mut rounds);
    let chains: Vec<&Chain> = team.rovers.iter().map(Casper::plan).collect();
    rounds.plan = team_plan(problem, instance, &chains);
    rounds.deleted = team.central.deleted().collect();
    rounds.central_operations = team.central.operations();
    Ok(rounds)
}

/// The plan of a team whose rovers have these chains.
pub fn team_plan(problem: &Problem, instance: &Instance, chains: &[&Chain]) -> TeamPlan {
    let goals = instance.goals();
    let stops = |chain: &&Chain| {
        let nodes = chain.nodes().iter();
        let stop = nodes.map(|node| {
            let task = node.visit.task;
            let name = match task.checked_sub(goals) {
                Some(activity) => &problem.activities[activity].name,
                None => &problem.goals[task].name,
            };
            Stop {
                task: name.clone(),
                sol: node.sol,
                start_ms: node.start_ms,
            }
        });
        stop.collect()
    };
    TeamPlan {
        rovers: chains.iter().map(stops).collect(),
    }
}

struct Team {
    rovers: Vec<Casper>,
    central: Central,
    /// Of the plans as they are, which no rover knows.
    truth: Score,
}

impl Team {
    fn new(instance: &Instance, config: &PlannerConfig, key: RandomKey) -> Result<Team, Unmet> {
        let rovers = 0..instance.vehicles().len();
        let rovers = rovers.map(|rover| Casper::new(instance, rover, config, key));
        Ok(Team {
            rovers: rovers.collect::<Result<_, _>>()?,
            central: Central::new(instance, config),
            truth: Score::new(instance),
        })
    }

    /// Hands assignments to the rovers that they name, what is required before what requires it. A mandatory
    /// goal for which a rover has no room goes to another.
    fn deliver(&mut self, instance: &Instance, mut assigned: Vec<Assignment>) -> Result<(), Unmet> {
        assigned.sort_by_key(|assignment| (depth(instance, assignment.goal), assignment.goal));
        for mut assignment in assigned {
            let goal = assignment.goal;
            while let Err(unmet) = self.hand_over(instance, &assignment) {
                let rover = unmet.rover;
                assignment = self.central.shed(instance, goal, rover).ok_or(unmet)?;
            }
        }
        Ok(())
    }

    /// A mandatory goal that nobody can do at all cannot be given up.
    fn refuse_hopeless(&mut self, instance: &Instance) -> Result<(), Unmet> {
        let deleted = self.central.deleted().map(|(goal, _)| goal);
        let mut mandatory = deleted.filter(|goal| instance.task(*goal).mandatory);
        match mandatory.next() {
            Some(goal) => self.rovers[0].assign(instance, goal, None),
            None => Ok(()),
        }
    }

    fn hand_over(&mut self, instance: &Instance, assignment: &Assignment) -> Result<(), Unmet> {
        let mut rovers = assignment.rovers.iter();
        rovers.try_for_each(|&rover| {
            self.rovers[rover].assign(instance, assignment.goal, assignment.start_ms)
        })
    }

    fn round(
        &mut self,
        instance: &Instance,
        rounds: &mut Rounds,
        is_last: bool,
    ) -> Result<(), Unmet> {
        let (mut iterations, mut operations, mut shed) = (0, 0, Vec::new());
        for (number, rover) in self.rovers.iter_mut().enumerate() {
            let step = rover.step(instance);
            iterations += step.iterations;
            operations += step.operations;
            shed.extend(step.shed.into_iter().map(|goal| (goal, number)));
        }
        rounds.shed += shed.len() as u64;
        // Links carry what is held after a step, and only then what comes of it.
        self.tell(instance);
        self.enter(instance).push(rounds);
        rounds.iterations.push(f64::from(iterations));
        rounds.operations.push(operations as f64);
        let shed_goals = by_goal(&shed);
        let joint = shed_goals.iter().map(|(goal, _)| *goal);
        let mut joint: Vec<usize> = joint.filter(|goal| instance.is_joint(*goal)).collect();
        joint.sort_unstable();
        // Nobody waits for who does not come; after the last round all part at once.
        for goal in joint.into_iter().filter(|_| !is_last) {
            let mut rovers = self.rovers.iter_mut();
            rovers.try_for_each(|rover| rover.withdraw(instance, goal))?;
        }
        let mut assigned = Vec::new();
        for (goal, rovers) in &shed_goals {
            assigned.extend(self.central.shed_by(instance, *goal, rovers));
        }
        if shed.is_empty() {
            assigned.extend(self.central.offer_pool(instance));
        }
        rounds.reassigned += assigned.len() as u64;
        if is_last {
            // Nobody plans any more.
            return Ok(());
        }
        self.deliver(instance, assigned)
    }

    /// All tell all what they hold.
    fn tell(&mut self, instance: &Instance) {
        let held: Vec<Vec<usize>> = self
            .rovers
            .iter()
            .map(|rover| rover.held(instance))
            .collect();
        for (number, rover) in self.rovers.iter_mut().enumerate() {
            for (other, goals) in held.iter().enumerate() {
                if other != number {
                    rover.hear(other, goals);
                }
            }
        }
    }

    /// Takes goals out of plans for which too few rovers have found room. A rover that has to do something
    /// mandatory may then have no room for another goal for two, which its partner takes out in turn.
    fn part(&mut self, instance: &Instance) -> Result<(), Unmet> {
        loop {
            let holders = self.holders(instance);
            let stays = |goal: usize| holders[goal] >= instance.task(goal).rovers;
            let mut rovers = self.rovers.iter_mut();
            rovers.try_for_each(|rover| rover.part(instance, stays))?;
            let left = self.holders(instance);
            let whole = |goal: usize| left[goal] == 0 || left[goal] >= instance.task(goal).rovers;
            if (0..instance.goals()).all(whole) {
                return Ok(());
            }
        }
    }

    /// By goal: how many rovers have it in their plans.
    fn holders(&self, instance: &Instance) -> Vec<u32> {
        let mut holders = vec![0; instance.goals()];
        for rover in &self.rovers {
            let goals = rover.plan().goals(instance);
            goals.for_each(|goal| holders[goal] += 1);
        }
        holders
    }

    /// What the plans of all are worth.
    fn enter(&mut self, instance: &Instance) -> Value {
        let mut holders = vec![0; instance.goals()];
        let mut traverse_mm = 0;
        for (number, rover) in self.rovers.iter().enumerate() {
            let goals: Vec<usize> = rover.plan().goals(instance).collect();
            goals.iter().for_each(|goal| holders[*goal] += 1);
            self.truth.hear(number, &goals);
            traverse_mm += rover.plan().drive_mm(instance);
        }
        let achieved = (0..instance.goals())
            .filter(|&goal| holders[goal] > 0 && holders[goal] >= instance.task(goal).rovers);
        Value {
            score: self.truth.value(),
            goals: achieved.count() as f64,
            traverse_m: traverse_mm as f64 / 1e3,
        }
    }
}

/// Goals that were shed, each once, in the order in which they were first, and by whom.
pub(crate) fn by_goal(shed: &[(usize, usize)]) -> Vec<(usize, Vec<usize>)> {
    let mut goals: Vec<(usize, Vec<usize>)> = Vec::new();
    for &(goal, rover) in shed {
        match goals.iter_mut().find(|(known, _)| *known == goal) {
            Some((_, rovers)) => rovers.push(rover),
            None => goals.push((goal, vec![rover])),
        }
    }
    goals
}

/// How many goals have to be achieved one after the other before a goal.
fn depth(instance: &Instance, goal: usize) -> usize {
    let requires = instance.requires(goal).iter();
    let depths = requires.map(|&other| depth(instance, other) + 1);
    depths.max().unwrap_or(0)
}

struct Value {
    score: f64,
    goals: f64,
    traverse_m: f64,
}

impl Value {
    fn push(self, rounds: &mut Rounds) {
        rounds.score.push(self.score);
        rounds.goals.push(self.goals);
        rounds.traverse_m.push(self.traverse_m);
    }
}
