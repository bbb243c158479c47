//! What must hold in every survey, told from outside: the protocol's invariants by what is written, and whether
//! plans can be carried out and are. It shares no code with planners.

use farside::{SimDuration, SimTime};

use super::messages::{Activity, ActivityBegan, ActivityEnd, ActivityEnded, PlanMade, Window};
use super::tally::SurveyTally;
use crate::shac::{CentreWrite, GoalKey, HoldingState, OwnerWrite};

/// By how much figures of a plan may be off \[J\]: rounding to whole microjoules.
const ROUNDING_J: f64 = 1.0;
/// By how much a way may be longer than what is driven \[m\]: rounding to whole millimetres, leg by leg.
const ROUNDING_M: f64 = 0.05;

impl SurveyTally {
    /// Before an owner's write is carried out.
    pub(super) fn check_owner(&mut self, rover: usize, now: SimTime, write: &OwnerWrite) {
        match write {
            OwnerWrite::Held(holding) => {
                let goal = holding.goal.key;
                let has_lease = |other: usize| {
                    let held = self.rovers[other].owner.held.get(&goal);
                    other != rover && held.is_some_and(|held| held.lease_end > now)
                };
                let other = (0..self.rovers.len()).find(|other| has_lease(*other));
                if let Some(other) = other.filter(|_| holding.lease_end > now) {
                    let what =
                        format!("{now}: rovers {other} and {rover} have a lease of {goal:?}");
                    self.blame_sharing(what);
                }
                let ends = now + holding.goal.parameters.duration;
                if holding.started == Some(now) && ends > holding.lease_end {
                    let lease_end = holding.lease_end;
                    self.blame_sharing(format!(
                        "{now}: rover {rover} starts {goal:?}, which ends at {ends}, its lease at {lease_end}"
                    ));
                }
            }
            OwnerWrite::Closed(closing) => {
                let held = self.rovers[rover].owner.held.get(&closing.goal);
                let has_started = held.is_some_and(|held| held.started.is_some());
                use HoldingState::{Cancelled, Lapsed, Released};
                if has_started && matches!(closing.state, Released | Cancelled | Lapsed) {
                    let (goal, state) = (closing.goal, closing.state);
                    let what = format!("{now}: rover {rover} has started {goal:?}, now {state:?}");
                    self.blame_sharing(what);
                }
            }
            _ => {}
        }
    }

    /// Before a centre's write is carried out: editions only grow, so that nothing that was withdrawn comes back.
    pub(super) fn check_centre(&mut self, site: u32, now: SimTime, write: &CentreWrite) {
        let CentreWrite::Goal(record) = write else {
            return;
        };
        let goal = record.wish.goal.key;
        let centre = self.centres.get(&site);
        let before = centre.and_then(|centre| centre.durable.table.get(&goal));
        if before.is_some_and(|before| before.wish.revision > record.wish.revision) {
            self.blame_sharing(format!(
                "{now}: an old edition of {goal:?} came back at site {site}"
            ));
        }
    }

    /// Whether a plan can be carried out: in order, within windows, with the energy and the memory that there is,
    /// and no faster than rovers drive.
    pub(super) fn check_plan(&mut self, rover: usize, plan: &PlanMade, speed_m_per_s: f64) {
        let mut wrong: Vec<String> = Vec::new();
        for (at, one) in plan.activities.iter().enumerate() {
            let mut says = |what: String| wrong.push(format!("{:?}: {what}", one.activity));
            if one.ends < one.starts {
                says(format!("temporal: ends at {}, before it starts", one.ends));
            }
            if one.battery_j < plan.reserve_j - ROUNDING_J {
                let (has_j, least_j) = (one.battery_j, plan.reserve_j);
                says(format!("power: {has_j:.0} J are left of {least_j:.0} J"));
            }
            if one.memory_bits > plan.memory_size_bits || one.memory_bits < 0 {
                let (has, most) = (one.memory_bits, plan.memory_size_bits);
                says(format!("memory: {has} bit of {most} bit"));
            }
            if let Activity::Goal(goal) = one.activity
                && let Some(window) = self.window(plan.edition, goal)
                && (one.starts < window.opens || one.ends > window.closes)
            {
                says(format!("window: from {} to {}", one.starts, one.ends));
            }
            let Some(before) = at.checked_sub(1).map(|before| &plan.activities[before]) else {
                continue;
            };
            if one.starts < before.ends {
                says(format!(
                    "temporal: starts at {} before {}",
                    one.starts, before.ends
                ));
            }
            let way_m = libm::hypot(
                one.position_m[0] - before.position_m[0],
                one.position_m[1] - before.position_m[1],
            );
            let most_m = one.ends.since(before.ends).as_secs_f64() * speed_m_per_s;
            if way_m > most_m + ROUNDING_M {
                says(format!(
                    "temporal: {way_m:.2} m where {most_m:.2} m can be driven"
                ));
            }
        }
        let number = plan.number;
        for what in wrong {
            self.blame_plan(format!("plan {number} of rover {rover}: {what}"));
        }
    }

    /// When a goal may be done, by the list of an edition.
    fn window(&self, edition: u64, goal: GoalKey) -> Option<Window> {
        let goals = &self.list(edition)?.goals;
        goals.iter().find(|one| one.key == goal)?.window
    }

    /// Whether an activity may begin: not before its window, and one at a time.
    pub(super) fn check_begin(&mut self, rover: usize, now: SimTime, began: &ActivityBegan) {
        let activity = began.planned.activity;
        if let Some(other) = self.rovers[rover].running {
            let other = other.planned.activity;
            self.blame_plan(format!(
                "{now}: rover {rover} begins {activity:?} in {other:?}"
            ));
        }
        if let Some(window) = self.window_now(activity)
            && now < window.opens
        {
            let opens = window.opens;
            self.blame_plan(format!(
                "{now}: rover {rover} begins {activity:?}, open from {opens}"
            ));
        }
    }

    /// Whether what was done was done within its window.
    pub(super) fn check_end(&mut self, rover: usize, now: SimTime, ended: &ActivityEnded) {
        let activity = ended.planned.activity;
        if let Some(window) = self.window_now(activity)
            && ended.end == ActivityEnd::Done
            && now > window.closes + END_LATE
        {
            let closes = window.closes;
            self.blame_plan(format!(
                "{now}: rover {rover} ends {activity:?}, open until {closes}"
            ));
        }
    }

    fn window_now(&self, activity: Activity) -> Option<Window> {
        let Activity::Goal(goal) = activity else {
            return None;
        };
        self.window(self.lists.last()?.edition, goal)
    }
}

/// How much later than planned hardware may be at the most with an observation that was begun in time.
const END_LATE: SimDuration = SimDuration::from_secs(120);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shac::{Grant, Holding, Revision, SharedGoal};
    use crate::survey::messages::{GoalList, ListedGoal, PlanMode, PlannedActivity, ReplanCause};

    const GOAL: GoalKey = GoalKey::Numbered(1);

    fn at(seconds: u64) -> SimTime {
        SimTime::from_secs(seconds)
    }

    fn held(lease_end: SimTime, started: Option<SimTime>) -> OwnerWrite {
        OwnerWrite::Held(Holding {
            goal: SharedGoal::new(GOAL, [0.0; 2], SimDuration::from_secs(100)),
            revision: Revision::default(),
            grant: Grant::default(),
            lease_end,
            confirmed: false,
            started,
        })
    }

    fn activity(activity: Activity, starts: u64, ends: u64, east_m: f64) -> PlannedActivity {
        PlannedActivity {
            activity,
            position_m: [east_m, 0.0],
            starts: at(starts),
            ends: at(ends),
            battery_j: 10.0,
            memory_bits: 5,
        }
    }

    /// A plan that can be carried out.
    fn plan() -> PlanMade {
        PlanMade {
            number: 1,
            cause: ReplanCause::Started,
            mode: PlanMode::Continuous,
            edition: 1,
            operations: 0,
            moved: 0,
            shed: Vec::new(),
            unmet: Vec::new(),
            score: 0.0,
            traverse_m: 0.0,
            reserve_j: 10.0,
            memory_size_bits: 5,
            activities: vec![
                activity(Activity::Communication(0), 0, 10, 0.0),
                activity(Activity::Drive(GOAL), 10, 30, 2.0),
                activity(Activity::Goal(GOAL), 40, 50, 2.0),
            ],
        }
    }

    fn tally() -> SurveyTally {
        let mut tally = SurveyTally::new(2);
        let window = Window {
            opens: at(40),
            closes: at(50),
        };
        tally.lists.push(GoalList {
            edition: 1,
            goals: vec![ListedGoal {
                key: GOAL,
                observation: crate::analysis::goals::Observation::PointImage,
                rock: None,
                position_m: [2.0, 0.0],
                weight: 1.0,
                mandatory: false,
                window: Some(window),
                requires: Vec::new(),
                partner: None,
            }],
            combinations: Vec::new(),
        });
        tally
    }

    #[test]
    fn each_way_in_which_a_plan_cannot_be_carried_out_is_seen() {
        let wrongs = |change: &dyn Fn(&mut PlanMade)| {
            let (mut tally, mut plan) = (tally(), plan());
            change(&mut plan);
            tally.check_plan(0, &plan, 0.1);
            tally.violations.join("; ")
        };
        assert_eq!(wrongs(&|_| {}), "");
        assert!(wrongs(&|plan| plan.reserve_j = 12.0).contains("power"));
        assert!(wrongs(&|plan| plan.memory_size_bits = 4).contains("memory"));
        assert!(wrongs(&|plan| plan.activities[2].starts = at(39)).contains("window"));
        assert!(wrongs(&|plan| plan.activities[2].ends = at(51)).contains("window"));
        assert!(wrongs(&|plan| plan.activities[1].starts = at(9)).contains("temporal"));
        assert!(wrongs(&|plan| plan.activities[1].ends = at(5)).contains("temporal"));
        assert!(wrongs(&|plan| plan.activities[1].position_m[0] = 4.0).contains("driven"));
    }

    #[test]
    fn two_leases_a_late_start_and_a_release_after_the_start_are_seen() {
        let mut tally = tally();
        tally.owner_wrote(0, &held(at(500), None));
        tally.check_owner(1, at(499), &held(at(900), None));
        assert_eq!(tally.sharing_violations, 1);
        tally.check_owner(1, at(500), &held(at(900), None));
        assert_eq!(tally.sharing_violations, 1);
        tally.check_owner(0, at(401), &held(at(500), Some(at(401))));
        assert_eq!(tally.sharing_violations, 2);
        tally.owner_wrote(0, &held(at(500), Some(at(400))));
        let closing = crate::shac::Closing {
            goal: GOAL,
            grant: Grant::default(),
            state: HoldingState::Released,
            reason: None,
            capacity: 0,
            outcome: None,
        };
        tally.check_owner(0, at(420), &OwnerWrite::Closed(closing));
        assert_eq!(tally.sharing_violations, 3);
    }

    #[test]
    fn what_runs_outside_its_window_or_beside_something_else_is_seen() {
        let planned = activity(Activity::Goal(GOAL), 40, 50, 2.0);
        let began = ActivityBegan {
            plan: 1,
            planned,
            battery_j: 10.0,
            memory_bits: 5,
        };
        let mut tally = tally();
        tally.check_begin(0, at(40), &began);
        assert_eq!(tally.plan_violations, 0);
        tally.check_begin(0, at(39), &began);
        assert_eq!(tally.plan_violations, 1);
        tally.rovers[0].running = Some(began);
        tally.check_begin(0, at(41), &began);
        assert_eq!(tally.plan_violations, 2);
        let ended = ActivityEnded {
            plan: 1,
            planned,
            began: at(40),
            end: ActivityEnd::Done,
            battery_j: 10.0,
            memory_bits: 5,
        };
        tally.check_end(0, at(50) + END_LATE, &ended);
        assert_eq!(tally.plan_violations, 2);
        tally.check_end(0, at(171), &ended);
        assert_eq!(tally.plan_violations, 3);
    }
}
