//! When and by whom goals for two rovers are done: the two that are nearest, at a time at which both can be there,
//! in the light, within the leases that they get now.

use farside::{SimDuration, SimTime};

use super::TeamPlanner;
use crate::shac::{Centre, GoalKey, Parameters, Vacancy};
use crate::sharing::TeamMove;
use crate::survey::costs::Cost;
use crate::survey::outlook::WAITS;

/// How much time rovers have to end what they are at.
const LEAD: SimDuration = SimDuration::from_secs(3600);

/// How many times as long as in a straight line at full speed a drive is taken to last.
const DETOURS: f64 = 3.0;

/// After which time the centre looks again at a goal for which it found no meeting.
const AGAIN: SimDuration = SimDuration::from_secs(1800);

impl TeamPlanner {
    /// Makes an appointment for each goal for two that nobody has, if there can be one now.
    pub(super) fn appoint(&mut self, now: SimTime, centre: &Centre) {
        for vacancy in centre.vacancies(now) {
            let Some(partner) = vacancy.partner else {
                continue;
            };
            let again = self.again.get(&vacancy.goal).copied();
            if again.is_some_and(|again| now < again) {
                continue;
            }
            // What the protocol refuses is not tried again at one instant.
            self.again.insert(vacancy.goal, now + AGAIN);
            let Some((rovers, starts)) = self.meeting(now, centre, &vacancy) else {
                continue;
            };
            for goal in [vacancy.goal, partner] {
                if let Some(record) = centre.durable().table.get(&goal) {
                    let to = Parameters {
                        start: starts,
                        ..record.wish.goal.parameters
                    };
                    self.moves.push_back(TeamMove::Change(goal, to));
                }
            }
            self.moves
                .push_back(TeamMove::Assign(vacancy.goal, rovers.to_vec()));
        }
    }

    /// When the next goal for two is looked at again.
    pub(super) fn appoints_again(&self, now: SimTime) -> impl Iterator<Item = SimTime> {
        let listed = self
            .again
            .iter()
            .filter(|(goal, _)| self.listed(**goal).is_some());
        listed.map(|(_, at)| *at).filter(move |at| *at > now)
    }

    /// Which two rovers meet, and when.
    fn meeting(
        &mut self,
        now: SimTime,
        centre: &Centre,
        vacancy: &Vacancy,
    ) -> Option<([u32; 2], SimTime)> {
        let listed = self.listed(vacancy.goal)?.clone();
        let lasts = Cost::of(listed.observation, &self.shared.rover)?.duration;
        let mut near: Vec<(f64, u32)> = vacancy
            .candidates
            .iter()
            .map(|&rover| {
                let [east_m, north_m] = self.vehicle(centre, rover as usize).position_m;
                let [to_east_m, to_north_m] = listed.position_m;
                (libm::hypot(to_east_m - east_m, to_north_m - north_m), rover)
            })
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let [first, second] = [near.first()?, near.get(1)?].map(|(_, rover)| *rover);
        let drive_s = DETOURS * near[1].0 / self.shared.rover.speed_m_per_s;
        let drive = SimDuration::from_secs_f64(drive_s);
        let rounds = self.rounds(centre, vacancy.goal);
        let mut starts = now + LEAD * (1 + u64::from(rounds)) + drive;
        let ends = lasts * 2 + WAITS;
        if let Some(window) = listed.window {
            starts = starts.max(window.opens);
            // Rather early than never.
            let latest = window.closes.as_nanos().saturating_sub(ends.as_nanos());
            starts = starts.min(SimTime::from_nanos(latest));
            if starts < (now + drive).max(window.opens) {
                return None;
            }
        }
        starts = self.in_light(starts, drive, ends)?;
        if listed
            .window
            .is_some_and(|window| starts + ends > window.closes)
        {
            return None;
        }
        let lease_end = centre.settings().lease_end(now);
        let fits = starts + ends + centre.settings().guard <= lease_end;
        fits.then_some(([first.min(second), first.max(second)], starts))
    }

    fn rounds(&self, centre: &Centre, goal: GoalKey) -> u32 {
        centre
            .durable()
            .table
            .get(&goal)
            .map_or(0, |record| record.rounds)
    }

    /// The first time from an instant on at which something that lasts so long ends in the light.
    fn in_light(
        &mut self,
        from: SimTime,
        drive: SimDuration,
        lasts: SimDuration,
    ) -> Option<SimTime> {
        let ms = |length: SimDuration| (length.as_nanos() / 1_000_000) as i64;
        let from_ms = ms(from.since(SimTime::ZERO));
        let first = self.forecast.sol_at(from_ms);
        (first..first + 2).find_map(|sol| {
            let [opens_ms, closes_ms] = self.forecast.day_ms(sol)?;
            let earliest_ms = from_ms.max(opens_ms + ms(drive));
            let fits = earliest_ms + ms(lasts) <= closes_ms;
            fits.then(|| SimTime::from_nanos(earliest_ms as u64 * 1_000_000))
        })
    }
}
