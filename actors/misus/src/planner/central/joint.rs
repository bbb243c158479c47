//! When two rovers are to meet: a time for a goal that needs both.

use super::{Assignment, Central, State};
use crate::planner::instance::Instance;

/// After how much of a sol two rovers can meet, beyond the drive from where they start: eighths of it are
/// tried one after the other.
const PARTS: i64 = 8;

impl Central {
    /// Two rovers, of these by nearness, and a time at which neither has another appointment that it
    /// could not come from or go to in time. Goals that were refused before are tried at other times first.
    pub(super) fn appoint(
        &mut self,
        instance: &Instance,
        goal: usize,
        near: &[(u64, usize)],
    ) -> Option<Assignment> {
        for (at, &(_, second)) in near.iter().enumerate().skip(1) {
            for &(_, first) in &near[..at] {
                if let Some(start_ms) = self.meeting_ms(instance, goal, [first, second]) {
                    return Some(Assignment {
                        goal,
                        rovers: vec![first, second],
                        start_ms: Some(start_ms),
                    });
                }
            }
        }
        None
    }

    fn meeting_ms(&mut self, instance: &Instance, goal: usize, rovers: [usize; 2]) -> Option<i64> {
        let task = instance.task(goal);
        let vehicles = rovers.map(|rover| &instance.vehicles()[rover]);
        let sols = vehicles
            .map(|vehicle| vehicle.sols.len())
            .into_iter()
            .min()?;
        let tries = sols as i64 * PARTS;
        let first = i64::from(self.offers[goal]) * (PARTS + 3) + goal as i64;
        for number in 0..tries {
            self.operations += 1;
            let number = (first + number) % tries;
            let (sol, part) = ((number / PARTS) as usize, number % PARTS);
            let opens = vehicles.map(|vehicle| vehicle.sols[sol].opens_ms);
            let closes = vehicles.map(|vehicle| vehicle.sols[sol].closes_ms);
            let (opens_ms, closes_ms) = (opens[0].max(opens[1]), closes[0].min(closes[1]));
            let drives = rovers
                .map(|rover| instance.drive_ms(rover, instance.vehicles()[rover].start, goal));
            let start_ms =
                (opens_ms + drives[0].max(drives[1]) + part * (closes_ms - opens_ms) / PARTS)
                    .max(task.opens_ms);
            let end_ms = start_ms + task.duration_ms;
            let free = rovers
                .iter()
                .all(|&rover| self.is_free(instance, goal, rover, start_ms));
            if end_ms <= closes_ms.min(task.closes_ms) && free {
                return Some(start_ms);
            }
        }
        None
    }

    /// Whether a rover can keep its other appointments besides one at this time, and do its activities.
    fn is_free(&self, instance: &Instance, goal: usize, rover: usize, start_ms: i64) -> bool {
        let end_ms = start_ms + instance.task(goal).duration_ms;
        let activities = instance.vehicles()[rover].activities.iter();
        let mut activities = activities.map(|(task, _)| instance.task(*task));
        let clashes = |opens_ms: i64, closes_ms: i64, between_ms: i64| {
            start_ms < closes_ms + between_ms && opens_ms < end_ms + between_ms
        };
        if activities.any(|task| {
            clashes(
                task.closes_ms - task.duration_ms,
                task.opens_ms + task.duration_ms,
                0,
            )
        }) {
            return false;
        }
        let appointments = self.states.iter().filter_map(|state| match state {
            State::Assigned(at) if at.rovers.contains(&rover) => {
                at.start_ms.map(|ms| (at.goal, ms))
            }
            _ => None,
        });
        let mut appointments = appointments;
        !appointments.any(|(other, ms)| {
            let drive_ms = instance.drive_ms(rover, goal, other);
            clashes(ms, ms + instance.task(other).duration_ms, drive_ms)
        })
    }
}
