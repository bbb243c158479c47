//! What the centre decides: it brings the protocol's goals into line with the goal list, shares out what nobody
//! has, and declares what cannot be done any more. It knows where rovers were last and how long goals take, and
//! nothing of batteries and memory (section 3.1).

mod meetings;

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use farside::SimTime;
use farside_actors::processor::Processor;

use super::costs::Cost;
use super::messages::{GoalList, GoalsShared, ListedGoal};
use super::outlook::Forecast;
use super::shared::Shared;
use crate::planner::central::{Open, share};
use crate::planner::instance::Instance;
use crate::planner::objective::ObjectiveConfig;
use crate::planner::problem::{FORMAT, Goal, Problem, ProblemError, Rover, Sol};
use crate::shac::{
    Centre, Chooser, GoalKey, Parameters, Reason, SharedGoal, Standing, Term, Vacancy,
};
use crate::sharing::{TeamMind, TeamMove};

/// A day \[ms\]. Tours have no end, so that it does not matter how long it is.
const DAY_MS: i64 = 86_400_000;

/// What the centre decides.
pub(super) struct TeamPlanner {
    shared: Arc<Shared>,
    processor: Processor,
    list: GoalList,
    /// For which list and term goals were brought into line.
    in_line: Option<(u64, Term)>,
    moves: VecDeque<TeamMove>,
    /// What was open when goals were shared out last.
    seen: Vec<Vacancy>,
    /// Who is to get what, and when the processor is done with that.
    shares: VecDeque<(GoalKey, u32)>,
    ready: SimTime,
    wake: SimTime,
    told: Option<GoalsShared>,
    fault: Option<ProblemError>,
    /// When it is light, for meetings.
    forecast: Forecast,
    /// When goals for two rovers are looked at again.
    again: BTreeMap<GoalKey, SimTime>,
}

impl TeamPlanner {
    pub(super) fn new(shared: Arc<Shared>, processor: Processor) -> TeamPlanner {
        let site = &shared.site;
        TeamPlanner {
            forecast: Forecast::new(
                site.sky,
                site.starts_s,
                &shared.rover,
                site.config.sun_least_rad,
                shared.execution.sun_share,
            ),
            again: BTreeMap::new(),
            shared,
            processor,
            list: GoalList::default(),
            in_line: None,
            moves: VecDeque::new(),
            seen: Vec::new(),
            shares: VecDeque::new(),
            ready: SimTime::ZERO,
            wake: SimTime::MAX,
            told: None,
            fault: None,
        }
    }

    /// The list that holds.
    pub(super) fn list(&self) -> &GoalList {
        &self.list
    }

    /// Takes a list, if it is newer.
    pub(super) fn take(&mut self, list: GoalList) {
        if list.edition > self.list.edition {
            self.list = list;
        }
    }

    /// What was shared out since it was asked last.
    ///
    /// # Errors
    /// When the abstract plan has no sense, which only a bug can cause.
    pub(super) fn told(&mut self) -> Result<Option<GoalsShared>, ProblemError> {
        match self.fault.take() {
            None => Ok(self.told.take()),
            Some(fault) => Err(fault),
        }
    }

    fn listed(&self, goal: GoalKey) -> Option<&ListedGoal> {
        let at = self.list.goals.binary_search_by_key(&goal, |one| one.key);
        at.ok().map(|at| &self.list.goals[at])
    }

    /// A goal as the protocol shares it; none if no rover has an instrument for it.
    fn shared_goal(&self, goal: &ListedGoal) -> Option<SharedGoal> {
        let cost = Cost::of(goal.observation, &self.shared.rover)?;
        let mut shared = SharedGoal::new(goal.key, goal.position_m, cost.duration);
        shared.partner = goal.partner;
        shared.parameters.memory_bits = cost.memory_bits as f64;
        shared.parameters.weight = goal.weight;
        shared.parameters.start = goal.window.map_or(SimTime::ZERO, |window| window.opens);
        Some(shared)
    }

    /// What brings the protocol's goals into line with the list: goals come, change and go. What has started or
    /// is achieved is left alone.
    fn bring_into_line(&mut self, centre: &Centre) {
        let table = &centre.durable().table;
        let mut moves = VecDeque::new();
        for goal in &self.list.goals {
            let Some(wanted) = self.shared_goal(goal) else {
                continue;
            };
            let known = table.get(&goal.key);
            let is_achieved = centre.standing(goal.key) == Some(Standing::Achieved);
            match known {
                _ if is_achieved => {}
                Some(known) if !known.wish.withdrawn => {
                    let now = known.wish.goal.parameters;
                    let has_started = known.holder.is_some_and(|holder| holder.started);
                    let to = Parameters {
                        weight: wanted.parameters.weight,
                        ..now
                    };
                    let to = match has_started {
                        true => to,
                        false => Parameters {
                            target_m: wanted.parameters.target_m,
                            // When two rovers meet is the centre's to say.
                            start: match goal.partner {
                                Some(_) => now.start,
                                None => wanted.parameters.start,
                            },
                            ..to
                        },
                    };
                    if to != now {
                        moves.push_back(TeamMove::Change(goal.key, to));
                    }
                }
                _ => moves.push_back(TeamMove::Add(wanted)),
            }
        }
        for (&goal, record) in table {
            let has_started = record.holder.is_some_and(|holder| holder.started);
            let is_over = centre.standing(goal) == Some(Standing::Achieved);
            if self.listed(goal).is_none() && !record.wish.withdrawn && !has_started && !is_over {
                moves.push_back(TeamMove::Withdraw(goal));
            }
        }
        self.moves = moves;
    }

    /// A goal that nobody has and that cannot be done any more, and why.
    fn hopeless(&self, now: SimTime, centre: &Centre) -> Option<TeamMove> {
        centre.standings().find_map(|(goal, standing)| {
            if standing != Standing::Pooled || !centre.is_settled(now) {
                return None;
            }
            let listed = self.listed(goal)?;
            let cost = Cost::of(listed.observation, &self.shared.rover)?;
            let is_late = listed
                .window
                .is_some_and(|window| now.max(window.opens) + cost.duration > window.closes);
            let lacks = listed
                .requires
                .iter()
                .any(|other| matches!(centre.standing(*other), Some(Standing::Unachievable(_))));
            match (is_late, lacks) {
                (true, _) => Some(TeamMove::Declare(goal, Reason::Time)),
                (false, true) => Some(TeamMove::Declare(goal, Reason::Declared)),
                (false, false) => None,
            }
        })
    }

    /// Shares out what is open, if that is not what was seen before.
    fn share_out(&mut self, now: SimTime, centre: &Centre) {
        let vacancies = centre.vacancies(now);
        if vacancies == self.seen {
            return;
        }
        let abstracted = Abstract::of(self, centre, &vacancies);
        self.seen = vacancies;
        let Some(Abstract {
            problem,
            keys,
            owned,
            open,
        }) = abstracted
        else {
            return;
        };
        let instance = match Instance::new(&problem) {
            Ok(instance) => instance,
            Err(error) => {
                self.fault = Some(error);
                return;
            }
        };
        let shares = share(&instance, &owned, &open, self.shared.planner.imbalance);
        let given = shares.given.iter();
        self.shares = given
            .map(|&(goal, rover)| (keys[goal], rover as u32))
            .collect();
        self.ready = now + self.processor.time_for(now, shares.operations);
        let told = self.told.get_or_insert_default();
        told.open += open.len() as u32;
        told.shed += open.iter().filter(|one| one.shed).count() as u32;
        told.given += shares.given.len() as u32;
        told.operations += shares.operations;
    }

    /// When something changes by itself: the processor is done, or a window is too short from then on.
    fn set_wake(&mut self, now: SimTime) {
        let ready = (!self.shares.is_empty()).then_some(self.ready);
        let late = self.list.goals.iter().filter_map(|goal| {
            let window = goal.window?;
            let cost = Cost::of(goal.observation, &self.shared.rover)?;
            let last = window.closes.as_nanos();
            let last = last.saturating_sub(cost.duration.as_nanos());
            Some(SimTime::from_nanos(last.saturating_add(1)))
        });
        let all = ready
            .into_iter()
            .chain(late)
            .chain(self.appoints_again(now));
        self.wake = all.filter(|at| *at > now).min().unwrap_or(SimTime::MAX);
    }
}

impl TeamMind for TeamPlanner {
    fn next(&mut self, now: SimTime, centre: &Centre, _refused: Option<&str>) -> Option<TeamMove> {
        // What the protocol refuses has changed meanwhile, and is looked at again when something changes.
        if !centre.is_in_office(now) || self.list.edition == 0 {
            self.wake = SimTime::MAX;
            return None;
        }
        let line = (self.list.edition, centre.durable().office.term);
        if self.in_line != Some(line) {
            self.in_line = Some(line);
            self.bring_into_line(centre);
        }
        if let Some(next) = self.moves.pop_front() {
            return Some(next);
        }
        if let Some(next) = self.hopeless(now, centre) {
            return Some(next);
        }
        if centre.settings().protocol.chooser == Chooser::Planner {
            self.appoint(now, centre);
            if let Some(next) = self.moves.pop_front() {
                return Some(next);
            }
            if self.shares.is_empty() {
                self.share_out(now, centre);
            }
            if now >= self.ready
                && let Some((goal, rover)) = self.shares.pop_front()
            {
                return Some(TeamMove::Assign(goal, vec![rover]));
            }
        }
        self.set_wake(now);
        None
    }

    fn wake(&self) -> SimTime {
        self.wake
    }
}

/// The abstract plan's problem: all goals that somebody has, and those that are open.
struct Abstract {
    problem: Problem,
    keys: Vec<GoalKey>,
    owned: Vec<Vec<usize>>,
    open: Vec<Open>,
}

impl Abstract {
    /// None if nothing is open.
    fn of(planner: &TeamPlanner, centre: &Centre, vacancies: &[Vacancy]) -> Option<Abstract> {
        let table = &centre.durable().table;
        let rovers = planner.shared.site.rovers.len();
        let mut owners: BTreeMap<GoalKey, usize> = BTreeMap::new();
        for (goal, standing) in centre.standings() {
            if let Standing::Owned { rover } = standing {
                owners.insert(goal, rover as usize);
            }
        }
        let vacant = vacancies
            .iter()
            .filter(|one| one.partner.is_none() && planner.listed(one.goal).is_some());
        let vacant: Vec<&Vacancy> = vacant.collect();
        if vacant.is_empty() {
            return None;
        }
        let keys: Vec<GoalKey> = owners
            .keys()
            .copied()
            .chain(vacant.iter().map(|one| one.goal))
            .collect();
        let number = |goal: &GoalKey| keys.iter().position(|key| key == goal);
        let mut owned = vec![Vec::new(); rovers];
        for (at, rover) in owners.values().enumerate() {
            owned[*rover].push(at);
        }
        let open = vacant.iter().enumerate().map(|(at, vacancy)| {
            let record = table.get(&vacancy.goal);
            Open {
                goal: owners.len() + at,
                candidates: planner.candidates(centre, &owners, vacancy),
                shed: record.is_some_and(|record| !record.refusals.is_empty()),
            }
        });
        let goals = keys.iter().filter_map(|key| {
            let goal = &table.get(key)?.wish.goal;
            let requires = planner.listed(*key).map_or(&[][..], |one| &one.requires);
            let duration_ms = goal.parameters.duration.as_nanos() / 1_000_000;
            Some(Goal {
                name: number(key)?.to_string(),
                rock: None,
                kind: None,
                position_m: goal.parameters.target_m,
                duration_ms: duration_ms as i64,
                power_mw: 0,
                memory_bits: 0,
                weight: goal.parameters.weight,
                window_ms: None,
                requires: requires
                    .iter()
                    .filter_map(number)
                    .map(|at| at.to_string())
                    .collect(),
                rovers: 1,
                mandatory: false,
            })
        });
        let problem = Problem {
            format: FORMAT.to_owned(),
            name: "abstract".to_owned(),
            // Users may wish for places beyond the field; those are refused elsewhere.
            side_m: 4.0 * planner.shared.site.side_m,
            rovers: (0..rovers)
                .map(|rover| planner.vehicle(centre, rover))
                .collect(),
            goals: goals.collect(),
            combinations: Vec::new(),
            activities: Vec::new(),
            // Tours are short whatever a metre costs.
            objective: ObjectiveConfig::default(),
        };
        Some(Abstract {
            problem,
            owned,
            open: open.collect(),
            keys,
        })
    }
}

impl TeamPlanner {
    /// Who may get a goal: whoever does not refuse it, and has or has achieved what it requires.
    fn candidates(
        &self,
        centre: &Centre,
        owners: &BTreeMap<GoalKey, usize>,
        vacancy: &Vacancy,
    ) -> Vec<usize> {
        let requires = self
            .listed(vacancy.goal)
            .map_or(&[][..], |one| &one.requires);
        let candidates = vacancy.candidates.iter().map(|rover| *rover as usize);
        let with = |other: &GoalKey, rover: usize| {
            let mut done = centre.durable().outcomes.of(*other);
            match (centre.standing(*other), owners.get(other)) {
                (Some(Standing::Achieved), _) => done.any(|one| one.rover as usize == rover),
                (_, Some(owner)) => *owner == rover,
                // It is open, too, and goes to the same rover.
                (_, None) => true,
            }
        };
        let may = |rover: &usize| requires.iter().all(|other| with(other, *rover));
        candidates.filter(may).collect()
    }

    /// A rover where it was last, as far as the centre knows: at the last goal that it has achieved.
    fn vehicle(&self, centre: &Centre, rover: usize) -> Rover {
        let durable = centre.durable();
        let his = durable
            .outcomes
            .iter()
            .filter(|one| one.rover as usize == rover);
        let last = his.last().and_then(|one| durable.table.get(&one.goal));
        let start = self.shared.starts_m[rover];
        let config = &self.shared.rover;
        Rover {
            name: self.shared.site.rovers[rover].clone(),
            position_m: last.map_or(start, |record| record.wish.goal.parameters.target_m),
            speed_mm_s: (1e3 * config.speed_m_per_s).max(1.0) as u32,
            drive_mw: 0,
            memory_bits: 0,
            stored_bits: 0,
            sols: vec![Sol {
                opens_ms: 0,
                closes_ms: DAY_MS,
                energy_uj: 0,
            }],
        }
    }
}
