//! Which goals to drop: sets of goals are tried, each by a search of its own.
//!
//! To drop one is tried first, for each goal. If none will do, goals are added one by one as long
//! as there is a plan, and those that were refused are to be dropped; then smaller sets are tried.
//!
//! Where goals can only stand in each other's way, a set that has no plan has none with more goals
//! either, and sets that contain it need no search. Where a goal may help another, as one that
//! produces what others consume, that is not so, and each set is searched.

use std::sync::Arc;

use super::recorder::Recorder;
use super::sets::{is_only_in_the_way, next_places, only};
use super::teller::{Teller, reason, told_goal};
use super::{Explanation, Outcome, Reason, ReasonKind, Request, Smallest, ToldGoal};
use crate::database::Owner;
use crate::model::{GoalId, Model, Problem};
use crate::plan::place;
use crate::search::complete::Complete;
use crate::search::schedule::{LoadError, Schedule};
use crate::search::{Repair, Settings, Stack, Verdict, chronological};

/// Sets of goals and what came of them.
pub(super) struct Tries<'a> {
    model: &'a Arc<Model>,
    /// Without the goals that cannot be of themselves.
    problem: Arc<Problem>,
    request: Request,
    /// The problem in its database.
    schedule: Schedule,
    /// Operations of databases before this one, and of repairs.
    spent: u64,
    /// Whether a goal can only stand in the way of others.
    only_in_the_way: bool,
    /// Sets without a plan, as proven.
    impossible: Vec<Vec<bool>>,
    /// Goals that cannot be of themselves, and why.
    hopeless: Vec<(ToldGoal, Reason)>,
}

/// What came of a set of goals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Tried {
    /// There is a plan with all of them.
    Found,
    /// There is none.
    Impossible,
    /// The budget did not say.
    Undecided,
}

/// Goals to drop, and what is known of how few they are.
struct Dropped {
    goals: Vec<GoalId>,
    smallest: Smallest,
}

impl<'a> Tries<'a> {
    pub(super) fn new(model: &'a Arc<Model>, problem: &Arc<Problem>, request: Request) -> Self {
        Tries {
            model,
            schedule: Schedule::empty(model.clone(), problem.clone()),
            problem: problem.clone(),
            request,
            spent: 0,
            only_in_the_way: is_only_in_the_way(model),
            impossible: Vec::new(),
            hopeless: Vec::new(),
        }
    }

    /// Why there is no plan with all goals in question. `fixed` is one of them that is not to be
    /// dropped.
    pub(super) fn explain(
        mut self,
        mut question: Vec<bool>,
        mut fixed: Option<GoalId>,
    ) -> Explanation {
        let goal = fixed.map(|goal| told_goal(&self.problem, goal));
        if let Err(told) = self.load(&mut question, &mut fixed) {
            return *told;
        }
        let mut told = self.blank(Outcome::Goals);
        if goal.is_some() && fixed.is_none() {
            // It cannot be of itself: no other goal is to blame.
            let hopeless = self.hopeless.pop();
            told.together = hopeless.iter().map(|at| at.0.clone()).collect();
            told.reasons = hopeless.into_iter().map(|at| at.1).collect();
            (told.goal, told.proven, told.only_way) = (goal, true, true);
            return self.finish(told);
        }
        let mut alone = vec![false; question.len()];
        if let Some(fixed) = fixed {
            alone[fixed] = true;
        }
        match self.attempt(&alone, self.share(8)) {
            Tried::Found => {}
            Tried::Impossible => {
                told.proven = true;
                match goal {
                    None => told.outcome = Outcome::Facts,
                    Some(_) => told.together = goal.iter().cloned().collect(),
                }
                told.goal = goal;
                self.record(&alone, &mut told);
                return self.finish(told);
            }
            Tried::Undecided => {
                if goal.is_none() {
                    told.outcome = Outcome::FactsUndecided;
                }
                told.goal = goal;
                self.record(&alone, &mut told);
                return self.finish(told);
            }
        }
        told.goal = goal;
        let all = if self.request.is_proven && self.hopeless.is_empty() {
            self.impossible.push(question.clone());
            Tried::Impossible
        } else {
            self.attempt(&question, self.share(4))
        };
        told.proven = all == Tried::Impossible || !self.hopeless.is_empty();
        if all == Tried::Found && self.hopeless.is_empty() {
            told.outcome = Outcome::Possible;
            return self.finish(told);
        }
        let dropped = match all {
            Tried::Found => Some(Dropped {
                goals: Vec::new(),
                smallest: Smallest::Proven,
            }),
            _ => self.mend(&question, &alone, all == Tried::Impossible),
        };
        let goals = dropped.as_ref().map(|at| at.goals.clone());
        self.tell_goals(&mut told, dropped);
        self.tell_reasons(&question, &alone, &goals.unwrap_or_default(), &mut told);
        self.finish(told)
    }

    fn tell_goals(&self, told: &mut Explanation, dropped: Option<Dropped>) {
        let Some(dropped) = dropped else { return };
        let hopeless = self.hopeless.iter().map(|at| at.0.clone());
        let goals = dropped.goals.iter();
        let goals = goals.map(|&goal| told_goal(&self.problem, goal));
        told.to_drop = hopeless.chain(goals).collect();
        told.goals = told.to_drop.iter().map(|goal| goal.name.clone()).collect();
        told.smallest = Some(dropped.smallest);
    }

    /// The reasons, and goals that cannot all be.
    fn tell_reasons(
        &mut self,
        question: &[bool],
        alone: &[bool],
        dropped: &[GoalId],
        told: &mut Explanation,
    ) {
        if let Some((goal, reason)) = self.hopeless.first() {
            told.together = vec![goal.clone()];
            told.reasons = vec![reason.clone()];
            told.only_way = true;
            return;
        }
        let mut stand = question.to_vec();
        if told.proven && self.only_in_the_way {
            stand = self.core(alone);
            let members = (0..stand.len()).filter(|&goal| stand[goal]);
            told.together = members.map(|goal| told_goal(&self.problem, goal)).collect();
        } else if self.record_added(question, dropped, told) {
            return;
        }
        self.record(&stand, told);
    }

    fn blank(&self, outcome: Outcome) -> Explanation {
        Explanation {
            outcome,
            goal: None,
            proven: false,
            goals: Vec::new(),
            to_drop: Vec::new(),
            smallest: None,
            together: Vec::new(),
            added: None,
            only_way: false,
            reasons: Vec::new(),
            operations: 0,
        }
    }

    fn finish(&self, mut told: Explanation) -> Explanation {
        told.operations = self.operations();
        told
    }

    fn operations(&self) -> u64 {
        self.spent + self.schedule.database.operations()
    }

    fn left(&self) -> u64 {
        self.request.operations.saturating_sub(self.operations())
    }

    /// One of so many parts of all operations.
    fn share(&self, parts: u64) -> u64 {
        self.request.operations / parts.max(1)
    }

    /// Loads the problem without goals that cannot be of themselves.
    ///
    /// # Errors
    ///
    /// If what is the case cannot be.
    fn load(
        &mut self,
        question: &mut Vec<bool>,
        fixed: &mut Option<GoalId>,
    ) -> Result<(), Box<Explanation>> {
        loop {
            let Err(error) = self.schedule.load() else {
                return Ok(());
            };
            let hopeless = match error {
                LoadError::Goal { goal, conflict } => {
                    let told = told_goal(&self.problem, goal);
                    let gone = told.name.clone();
                    let database = &self.schedule.database;
                    let reason =
                        Teller::new(database, &self.problem, &[], &gone).conflict(&conflict);
                    if question[goal] && *fixed != Some(goal) {
                        self.hopeless.push((told, reason));
                    } else if *fixed == Some(goal) {
                        self.hopeless.push((told, reason));
                        *fixed = None;
                        return Ok(());
                    }
                    goal
                }
                LoadError::Fact { fact, conflict } => {
                    return Err(Box::new(self.fact(fact, &conflict)));
                }
                LoadError::Level { .. } => {
                    let mut told = self.blank(Outcome::Facts);
                    let message = error.to_string();
                    told.reasons = vec![reason(ReasonKind::Amount, message, Vec::new())];
                    (told.proven, told.only_way) = (true, true);
                    return Err(Box::new(self.finish(told)));
                }
            };
            let mut kept = vec![true; question.len()];
            kept[hopeless] = false;
            question.remove(hopeless);
            *fixed = fixed.map(|at| at - usize::from(at > hopeless));
            self.spent += self.schedule.database.operations() + 1;
            self.problem = Arc::new(only(&self.problem, &kept));
            self.schedule = Schedule::empty(self.model.clone(), self.problem.clone());
        }
    }

    /// A fact that cannot be, with those before it.
    fn fact(&self, fact: usize, conflict: &crate::database::Conflict) -> Explanation {
        let at = &self.problem.facts[fact];
        let gone = format!(
            "{} on {}",
            self.model.predicates[at.predicate].name, self.model.timelines[at.timeline].name
        );
        let teller = Teller::new(&self.schedule.database, &self.problem, &[], &gone);
        let mut told = self.blank(Outcome::Facts);
        let mut reason = teller.conflict(conflict);
        let file = self.problem.files.get(at.position.file as usize);
        if let Some(file) = file.filter(|_| at.position.line > 0) {
            reason.place = format!("{file}:{}", at.position);
        } else {
            reason.place = place(self.model, at.position);
        }
        told.reasons = vec![reason];
        // Facts are put one after the other by their earliest starts: with times that are not
        // known, another order may be possible.
        let in_order = |owner: &Owner| matches!(owner, Owner::Sequence { .. });
        let known = self
            .problem
            .facts
            .iter()
            .all(|at| at.start.min == at.start.max);
        told.proven = known || !conflict.owners().iter().any(in_order);
        told.only_way = told.proven;
        self.finish(told)
    }

    /// Searches a plan with these goals and no others, first by the complete search, then by
    /// repair, each with half of a budget.
    fn attempt(&mut self, wanted: &[bool], budget: u64) -> Tried {
        let budget = budget.min(self.left());
        if budget == 0 {
            return Tried::Undecided;
        }
        let mut complete = Complete::new(&self.schedule);
        for (goal, &wanted) in wanted.iter().enumerate() {
            complete.want(goal, wanted);
        }
        let database = &mut self.schedule.database;
        database.push();
        let verdict = chronological(database, &mut complete, &mut Stack::default(), budget / 2);
        database.pop();
        self.spent += 1;
        match verdict {
            Verdict::Solved => Tried::Found,
            Verdict::Impossible(_) => {
                self.impossible.push(wanted.to_vec());
                Tried::Impossible
            }
            Verdict::OverBudget => self.repair(wanted, budget / 2),
        }
    }

    fn repair(&mut self, wanted: &[bool], budget: u64) -> Tried {
        let mut problem = only(&self.problem, wanted);
        for goal in &mut problem.goals {
            goal.weight = None;
        }
        let settings = Settings {
            operations: budget.min(self.left()),
            seed: self.request.seed,
        };
        let answer = Repair::default().first(self.model, &Arc::new(problem), settings);
        match answer {
            Ok(answer) => {
                self.spent += answer.operations;
                match answer.plan {
                    Some(_) => Tried::Found,
                    None => Tried::Undecided,
                }
            }
            Err(_) => Tried::Undecided,
        }
    }

    /// Whether a set is known to be without a plan.
    fn is_known(&mut self, wanted: &[bool]) -> bool {
        self.spent += 1;
        self.only_in_the_way
            && self.impossible.iter().any(|set| {
                let mut pairs = set.iter().zip(wanted);
                pairs.all(|(in_set, in_wanted)| !in_set || *in_wanted)
            })
    }

    /// Goals without which there is a plan.
    fn mend(&mut self, question: &[bool], alone: &[bool], is_proven: bool) -> Option<Dropped> {
        let members = 0..question.len();
        // What stands last is dropped first.
        let removable = members.filter(|&goal| question[goal] && !alone[goal]).rev();
        let removable: Vec<GoalId> = removable.collect();
        let share = self.share(4 * removable.len().max(1) as u64);
        let mut all_proven = is_proven;
        for &goal in &removable {
            match self.without(question, &[goal], share) {
                Tried::Found => {
                    let smallest = match is_proven {
                        true => Smallest::Proven,
                        false => Smallest::Found,
                    };
                    return Some(Dropped {
                        goals: vec![goal],
                        smallest,
                    });
                }
                Tried::Impossible => {}
                Tried::Undecided => all_proven = false,
            }
        }
        let grown = self.grow(question, alone, &removable)?;
        self.fewer(question, &removable, grown, all_proven)
    }

    fn without(&mut self, question: &[bool], dropped: &[GoalId], budget: u64) -> Tried {
        let mut wanted = question.to_vec();
        for &goal in dropped {
            wanted[goal] = false;
        }
        if self.is_known(&wanted) {
            return Tried::Impossible;
        }
        self.attempt(&wanted, budget)
    }

    /// Adds goals as long as there is a plan, until no more can be added.
    fn grow(&mut self, question: &[bool], alone: &[bool], removable: &[GoalId]) -> Option<Dropped> {
        let mut kept = alone.to_vec();
        let mut left: Vec<GoalId> = removable.iter().rev().copied().collect();
        let share = self.share(4 * left.len().max(1) as u64);
        loop {
            let before = left.len();
            let mut all_proven = true;
            let mut refused = Vec::new();
            for goal in std::mem::take(&mut left) {
                kept[goal] = true;
                let tried = match self.is_known(&kept) {
                    true => Tried::Impossible,
                    false => self.attempt(&kept, share),
                };
                if tried != Tried::Found {
                    kept[goal] = false;
                    all_proven &= tried == Tried::Impossible;
                    refused.push(goal);
                }
            }
            left = refused;
            // What was refused before others were added may go with them, unless goals can only
            // stand in the way.
            if left.len() < before && !self.only_in_the_way && !left.is_empty() {
                continue;
            }
            left.reverse();
            debug_assert!(left.iter().all(|&goal| question[goal]));
            return Some(Dropped {
                goals: left,
                smallest: match all_proven {
                    true => Smallest::Irreducible,
                    false => Smallest::Found,
                },
            });
        }
    }

    /// Tries sets of two goals and more that are smaller than one that will do.
    fn fewer(
        &mut self,
        question: &[bool],
        removable: &[GoalId],
        grown: Dropped,
        mut all_proven: bool,
    ) -> Option<Dropped> {
        let until = self.operations() + self.share(4);
        let share = self.share(64);
        for size in 2..grown.goals.len() {
            let mut places: Vec<usize> = (0..size).collect();
            loop {
                if self.operations() >= until || self.left() == 0 {
                    return Some(grown);
                }
                let set: Vec<GoalId> = places.iter().map(|&at| removable[at]).collect();
                match self.without(question, &set, share) {
                    Tried::Found => {
                        let smallest = match all_proven {
                            true => Smallest::Proven,
                            false => Smallest::Found,
                        };
                        return Some(Dropped {
                            goals: set,
                            smallest,
                        });
                    }
                    Tried::Impossible => {}
                    Tried::Undecided => all_proven = false,
                }
                if !next_places(&mut places, removable.len()) {
                    break;
                }
            }
        }
        let smallest = match all_proven {
            true => Smallest::Proven,
            false => grown.smallest,
        };
        Some(Dropped { smallest, ..grown })
    }

    /// Goals that cannot all be, from the fewest that are known: each is left out in turn, as long
    /// as it is proven that the others cannot be.
    fn core(&mut self, alone: &[bool]) -> Vec<bool> {
        let count = |set: &Vec<bool>| set.iter().filter(|at| **at).count();
        let fewest = self.impossible.iter().min_by_key(|set| count(set));
        let mut core = fewest.cloned().unwrap_or_default();
        let share = self.share(8 * count(&core).max(1) as u64);
        for goal in 0..core.len() {
            if !core[goal] || alone[goal] {
                continue;
            }
            core[goal] = false;
            if !self.is_known(&core) && self.attempt(&core, share) != Tried::Impossible {
                core[goal] = true;
            }
        }
        core
    }

    /// Searches a plan with the goals that are kept, adds the first of those to drop, and tells
    /// where that ended; whether there is anything to tell.
    fn record_added(
        &mut self,
        question: &[bool],
        dropped: &[GoalId],
        told: &mut Explanation,
    ) -> bool {
        let Some(&added) = dropped.first() else {
            return false;
        };
        let mut kept = question.to_vec();
        for &goal in dropped {
            kept[goal] = false;
        }
        let mut recorder = Recorder::new(&self.schedule, &kept);
        let mut stack = Stack::default();
        let budget = self.left() / 4;
        let database = &mut self.schedule.database;
        database.push();
        let begun = chronological(database, &mut recorder, &mut stack, budget);
        let mut is_told = false;
        if matches!(begun, Verdict::Solved) {
            recorder.begin_again();
            recorder.complete.want(added, true);
            let verdict = chronological(database, &mut recorder, &mut stack, budget);
            is_told = !matches!(verdict, Verdict::Solved);
        }
        database.pop();
        let reasons = recorder.reasons();
        if is_told && !reasons.is_empty() {
            told.added = Some(told_goal(&self.problem, added));
            told.reasons = reasons;
            return true;
        }
        false
    }

    /// Searches once more and tells where the way that got furthest ended.
    fn record(&mut self, wanted: &[bool], told: &mut Explanation) {
        let mut recorder = Recorder::new(&self.schedule, wanted);
        let mut stack = Stack::default();
        // There is something to tell after a few operations already.
        let budget = (self.left() / 4).max(1_000);
        let database = &mut self.schedule.database;
        database.push();
        let verdict = chronological(database, &mut recorder, &mut stack, budget);
        database.pop();
        told.only_way = matches!(verdict, Verdict::Impossible(_)) && !recorder.had_choice;
        told.reasons = recorder.reasons();
    }
}
