//! The tours of the centre's abstract plan: short in all, and even.

use crate::planner::instance::Instance;

/// How often all goals are looked at for a better tour, at the most.
const PASSES: usize = 10;

/// By rover, the goals in the order of its tour, which begins where the rover starts and ends anywhere.
#[derive(Clone, Debug)]
pub(super) struct Tours {
    goals: Vec<Vec<usize>>,
}

impl Tours {
    pub(super) fn new(instance: &Instance) -> Tours {
        Tours {
            goals: vec![Vec::new(); instance.vehicles().len()],
        }
    }

    /// Whose tour has a goal.
    pub(super) fn owner(&self, goal: usize) -> Option<usize> {
        self.goals.iter().position(|tour| tour.contains(&goal))
    }

    pub(super) fn remove(&mut self, goal: usize) {
        for tour in &mut self.goals {
            tour.retain(|other| *other != goal);
        }
    }

    pub(super) fn append(&mut self, goal: usize, rover: usize) {
        self.goals[rover].push(goal);
    }

    /// How far a goal is from the nearest place of a rover's tour \[mm\].
    pub(super) fn away_mm(&self, instance: &Instance, goal: usize, rover: usize) -> u64 {
        let start = instance.vehicles()[rover].start;
        let places = self.goals[rover].iter().chain([&start]);
        let away = places.map(|&place| u64::from(instance.length_mm(place, goal)));
        away.min().unwrap_or(u64::MAX)
    }

    /// Puts a goal where a rover's tour becomes least longer.
    pub(super) fn insert(&mut self, instance: &Instance, goal: usize, rover: usize) {
        self.put(instance, &[goal], rover);
    }

    /// Lays tours over these goals, beside those that tours have: the farthest first, each goal (with those
    /// that it requires or that require it) where the tour becomes least longer, among rovers that may have
    /// it and whose work stays within the even share and `imbalance` of it; then goals are moved from tour to
    /// tour, and stretches of tours turned round, while that makes them shorter. Goals that nobody may have
    /// are in no tour. Returns what was looked at.
    pub(super) fn build(
        &mut self,
        instance: &Instance,
        goals: &[usize],
        imbalance: f64,
        may_have: impl Fn(usize, usize) -> bool,
    ) -> u64 {
        let mut operations = 0;
        let work_ms = |group: &[usize]| -> i64 {
            group
                .iter()
                .map(|&goal| instance.task(goal).duration_ms)
                .sum()
        };
        let may = |group: &[usize], rover: usize| group.iter().all(|&goal| may_have(goal, rover));
        let mut loads_ms: Vec<i64> = self.goals.iter().map(|tour| work_ms(tour)).collect();
        let all_ms = work_ms(goals) + loads_ms.iter().sum::<i64>();
        let share = all_ms as f64 / self.goals.len() as f64;
        let most_ms = (share * (1.0 + imbalance)) as i64;
        let mut groups = groups(instance, goals);
        groups.sort_by_key(|group| {
            let away = self.goals.iter().enumerate();
            let away = away.map(|(rover, _)| self.away_mm(instance, group[0], rover));
            (std::cmp::Reverse(away.min()), group[0])
        });
        for group in &groups {
            let work_ms = work_ms(group);
            let rover = self.cheapest(instance, group, &mut operations, |rover| {
                may(group, rover) && loads_ms[rover] + work_ms <= most_ms
            });
            // Nobody has room: whoever has least to do.
            let all = 0..loads_ms.len();
            let least = || {
                all.filter(|rover| may(group, *rover))
                    .min_by_key(|rover| loads_ms[*rover])
            };
            let Some(rover) = rover.or_else(least) else {
                continue;
            };
            loads_ms[rover] += work_ms;
            self.put(instance, group, rover);
        }
        for _ in 0..PASSES {
            let before_mm = self.length_mm(instance);
            for group in &groups {
                let Some(from) = self.owner(group[0]) else {
                    continue;
                };
                let work_ms = work_ms(group);
                group.iter().for_each(|goal| self.remove(*goal));
                loads_ms[from] -= work_ms;
                let rover = self.cheapest(instance, group, &mut operations, |rover| {
                    rover == from || may(group, rover) && loads_ms[rover] + work_ms <= most_ms
                });
                let rover = rover.unwrap_or(from);
                loads_ms[rover] += work_ms;
                self.put(instance, group, rover);
            }
            for rover in 0..self.goals.len() {
                operations += self.two_opt(instance, rover);
            }
            if self.length_mm(instance) >= before_mm {
                break;
            }
        }
        operations
    }

    /// Of the rovers that may, the one whose tour becomes least longer by a group.
    fn cheapest(
        &self,
        instance: &Instance,
        group: &[usize],
        operations: &mut u64,
        may: impl Fn(usize) -> bool,
    ) -> Option<usize> {
        let rovers = (0..self.goals.len()).filter(|rover| may(*rover));
        let costs = rovers.map(|rover| {
            *operations += (group.len() * (self.goals[rover].len() + 1)) as u64;
            let added = group
                .iter()
                .map(|&goal| self.place(instance, goal, rover).0);
            (added.sum::<i64>(), rover)
        });
        costs.min().map(|(_, rover)| rover)
    }

    /// By how much a rover's tour becomes longer by a goal \[mm\], and where the goal is put for it.
    fn place(&self, instance: &Instance, goal: usize, rover: usize) -> (i64, usize) {
        let tour = &self.goals[rover];
        let length = |a: usize, b: usize| i64::from(instance.length_mm(a, b));
        let places = (0..=tour.len()).map(|at| {
            let before = match at {
                0 => instance.vehicles()[rover].start,
                at => tour[at - 1],
            };
            let added = length(before, goal);
            let after = tour
                .get(at)
                .map(|&after| length(goal, after) - length(before, after));
            (added + after.unwrap_or(0), at)
        });
        places.min().unwrap_or((0, 0))
    }

    fn put(&mut self, instance: &Instance, group: &[usize], rover: usize) {
        for &goal in group {
            let (_, at) = self.place(instance, goal, rover);
            self.goals[rover].insert(at, goal);
        }
    }

    /// How long all tours are together \[mm\].
    pub(super) fn length_mm(&self, instance: &Instance) -> u64 {
        let tours = self.goals.iter().enumerate();
        let lengths = tours.map(|(rover, tour)| {
            let mut place = instance.vehicles()[rover].start;
            let mut length_mm = 0;
            for &goal in tour {
                length_mm += u64::from(instance.length_mm(place, goal));
                place = goal;
            }
            length_mm
        });
        lengths.sum()
    }

    /// Turns stretches round as long as that makes a tour shorter.
    fn two_opt(&mut self, instance: &Instance, rover: usize) -> u64 {
        let mut operations = 0;
        let start = instance.vehicles()[rover].start;
        let tour = &mut self.goals[rover];
        let length = |a: usize, b: usize| i64::from(instance.length_mm(a, b));
        let mut better = true;
        while better {
            better = false;
            for first in 0..tour.len() {
                for last in first + 1..tour.len() {
                    operations += 1;
                    let before = if first == 0 { start } else { tour[first - 1] };
                    let mut change = length(before, tour[last]) - length(before, tour[first]);
                    if let Some(&after) = tour.get(last + 1) {
                        change += length(tour[first], after) - length(tour[last], after);
                    }
                    if change < 0 {
                        tour[first..=last].reverse();
                        better = true;
                    }
                }
            }
        }
        operations
    }
}

/// Goals that have to be with one rover, because they require one another; most are alone.
fn groups(instance: &Instance, goals: &[usize]) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    let mut grouped = vec![false; instance.goals()];
    for &goal in goals {
        if grouped[goal] {
            continue;
        }
        let mut group = vec![goal];
        grouped[goal] = true;
        let mut at = 0;
        while at < group.len() {
            let tied = instance.requires(group[at]).iter();
            for &other in tied.chain(instance.required_by(group[at])) {
                if !grouped[other] && goals.contains(&other) {
                    grouped[other] = true;
                    group.push(other);
                }
            }
            at += 1;
        }
        groups.push(group);
    }
    groups
}
