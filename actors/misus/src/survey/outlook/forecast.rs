//! What a rover expects of the Sun and of its battery: when it is light, how much power the array gives, and
//! how much charge is left when this and that is done.
//!
//! What this is not: the hardware's own electricity, which is in `farside_actors`. This is a rover's
//! model of it: it counts on less sunlight than there should be, and on what the array was last seen to yield.

use farside_actors::rover::RoverModel;
use farside_worlds::Sky;
use farside_worlds::sky::SOL_S;

/// How far apart the Sun is looked at \[ms\].
const NODE_MS: i64 = 300_000;

/// How often an interval is halved to find when the Sun is high enough: to far below a millisecond.
const HALVINGS: u32 = 40;

/// Something that takes power for a time, beyond what the body takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load {
    /// From when \[ms\].
    pub from_ms: i64,
    /// Until when \[ms\].
    pub until_ms: i64,
    /// How much \[W\].
    pub power_w: f64,
}

/// The charge of a battery over time, as it is expected to be.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    /// When, and how much then \[ms, J\], in order. In between it is straight.
    points: Vec<(i64, f64)>,
}

impl Profile {
    /// The charge at a time \[J\]; before the first and after the last instant, that of these.
    pub fn at_j(&self, at_ms: i64) -> f64 {
        let next = self.points.partition_point(|(when_ms, _)| *when_ms < at_ms);
        let (after_ms, after_j) = self.points[next.min(self.points.len() - 1)];
        let (before_ms, before_j) = self.points[next.saturating_sub(1)];
        if after_ms <= before_ms || at_ms >= after_ms || at_ms <= before_ms {
            return if at_ms <= before_ms {
                before_j
            } else {
                after_j
            };
        }
        let share = (at_ms - before_ms) as f64 / (after_ms - before_ms) as f64;
        before_j + share * (after_j - before_j)
    }

    /// The least charge between two times, and when it is first reached \[ms, J\]; None if nothing is
    /// known of that time.
    pub fn least_j(&self, from_ms: i64, until_ms: i64) -> Option<(i64, f64)> {
        let within = |(at_ms, _): &&(i64, f64)| (from_ms..=until_ms).contains(at_ms);
        let points = self.points.iter().filter(within).copied();
        points.min_by(|a, b| a.1.total_cmp(&b.1))
    }
}

/// A rover's model of the Sun and of its own electricity.
#[derive(Clone, Debug)]
pub struct Forecast {
    sky: Sky,
    starts_s: f64,
    /// The array's power for each W/m² of sunlight \[m²\].
    array_m2: f64,
    dust_log: f64,
    night_power_w: f64,
    awake_power_w: f64,
    sleep_power_w: f64,
    charge_efficiency: f64,
    capacity_j: f64,
    /// The share of the sunlight that is counted on.
    sun_share: f64,
    sun_least_deg: f64,
    /// The power of a clean array at the nodes \[W\], as far as anybody asked.
    nodes_w: Vec<f64>,
    /// By sol of the run: when it is light \[ms\], as far as anybody asked.
    days_ms: Vec<Option<[i64; 2]>>,
}

impl Forecast {
    /// Of a rover under a sky, in a run that starts at the sky's time `starts_s`; it works while the Sun
    /// is at least so high.
    pub fn new(
        sky: Sky,
        starts_s: f64,
        rover: &RoverModel,
        sun_least_rad: f64,
        sun_share: f64,
    ) -> Forecast {
        Forecast {
            sky,
            starts_s,
            array_m2: rover.array_m2 * rover.array_efficiency,
            dust_log: libm::log1p(-rover.dust_per_sol),
            night_power_w: rover.night_power_w,
            awake_power_w: rover.awake_power_w,
            sleep_power_w: rover.sleep_power_w,
            charge_efficiency: rover.charge_efficiency,
            capacity_j: rover.battery_j,
            sun_share,
            sun_least_deg: sun_least_rad.to_degrees(),
            nodes_w: Vec::new(),
            days_ms: Vec::new(),
        }
    }

    /// What the battery holds \[J\].
    pub fn capacity_j(&self) -> f64 {
        self.capacity_j
    }

    /// The sol of the run at a time, from 0.
    pub fn sol_at(&self, at_ms: i64) -> u32 {
        let first = libm::floor(self.starts_s / SOL_S);
        let sol = libm::floor((self.starts_s + at_ms as f64 * 1e-3) / SOL_S) - first;
        sol.max(0.0) as u32
    }

    /// A time of day \[s since local midnight\] in a sol of the run \[ms\]; below 0 before the run.
    pub fn time_ms(&self, sol: u32, of_day_s: f64) -> i64 {
        let first = libm::floor(self.starts_s / SOL_S);
        let at_s = (first + f64::from(sol)) * SOL_S + of_day_s - self.starts_s;
        libm::ceil(at_s * 1e3) as i64
    }

    /// When a rover can work in a sol of the run: while the Sun is high enough \[ms\]; None if it never is.
    pub fn day_ms(&mut self, sol: u32) -> Option<[i64; 2]> {
        while self.days_ms.len() <= sol as usize {
            let day = self.find_day(self.days_ms.len() as u32);
            self.days_ms.push(day);
        }
        self.days_ms[sol as usize]
    }

    fn find_day(&self, sol: u32) -> Option<[i64; 2]> {
        let is_light = |of_day_s: f64| {
            let at_s = self.starts_s + self.time_ms(sol, of_day_s) as f64 * 1e-3;
            self.sky.elevation_deg(at_s) >= self.sun_least_deg
        };
        let noon_s = 0.5 * SOL_S;
        if !is_light(noon_s) {
            return None;
        }
        // From noon to midnight, on either side, the Sun sinks.
        let edge = |midnight_s: f64| {
            if is_light(midnight_s) {
                return midnight_s;
            }
            let (mut light_s, mut dark_s) = (noon_s, midnight_s);
            for _ in 0..HALVINGS {
                let middle_s = 0.5 * (light_s + dark_s);
                match is_light(middle_s) {
                    true => light_s = middle_s,
                    false => dark_s = middle_s,
                }
            }
            light_s
        };
        let day_s = [edge(0.0), edge(SOL_S - 1.0)];
        let [opens_ms, closes_ms] = day_s.map(|of_day_s| self.time_ms(sol, of_day_s));
        (closes_ms > opens_ms).then_some([opens_ms.max(0), closes_ms.max(0)])
    }

    /// Whether a rover can work at a time.
    pub fn is_light(&mut self, at_ms: i64) -> bool {
        let sol = self.sol_at(at_ms);
        let day = self.day_ms(sol);
        day.is_some_and(|[opens_ms, closes_ms]| (opens_ms..closes_ms).contains(&at_ms))
    }

    /// What a clean array should yield at a time \[W\].
    pub fn array_w(&mut self, at_ms: i64) -> f64 {
        let (node, rest_ms) = (at_ms.max(0) / NODE_MS, at_ms.max(0) % NODE_MS);
        while self.nodes_w.len() as i64 <= node + 1 {
            let at_s = self.nodes_w.len() as f64 * (NODE_MS as f64 * 1e-3);
            let dust = libm::exp(self.dust_log * at_s / SOL_S);
            let sunlight_w_m2 = self.sky.power_w_m2(self.starts_s + at_s);
            self.nodes_w.push(self.array_m2 * dust * sunlight_w_m2);
        }
        let [before_w, after_w] = [0, 1].map(|next| self.nodes_w[node as usize + next]);
        before_w + rest_ms as f64 / NODE_MS as f64 * (after_w - before_w)
    }

    /// What flows into the battery at a time with nothing but the body at work \[W\]; `clean` is the share
    /// of its power that the array was last seen to yield. By day the body is awake.
    fn flow_w(&mut self, at_ms: i64, clean: f64) -> f64 {
        let array_w = self.array_w(at_ms);
        let body_w = match self.is_light(at_ms) {
            true => self.awake_power_w,
            false => self.sleep_power_w,
        };
        let warmth_w = (self.night_power_w - array_w).max(0.0);
        self.sun_share * clean * array_w - body_w - warmth_w
    }

    /// How much the battery would gain between two times if it had no limit, with nothing but the body at
    /// work \[J\].
    pub fn gain_j(&mut self, from_ms: i64, until_ms: i64, clean: f64) -> f64 {
        let mut gain_j = 0.0;
        let mut at_ms = from_ms;
        while at_ms < until_ms {
            let next_ms = ((at_ms / NODE_MS + 1) * NODE_MS).min(until_ms);
            let net_w = self.flow_w(at_ms + (next_ms - at_ms) / 2, clean);
            gain_j += self.stored_j(net_w * (next_ms - at_ms) as f64 * 1e-3);
            at_ms = next_ms;
        }
        gain_j
    }

    /// What of a flow arrives in the battery.
    fn stored_j(&self, energy_j: f64) -> f64 {
        match energy_j > 0.0 {
            true => self.charge_efficiency * energy_j,
            false => energy_j,
        }
    }

    /// How the battery's charge goes on from now, with these loads, in the order of their beginnings.
    pub fn profile(
        &mut self,
        from_ms: i64,
        battery_j: f64,
        clean: f64,
        loads: &[Load],
        until_ms: i64,
    ) -> Profile {
        let mut edges_ms: Vec<i64> = loads
            .iter()
            .flat_map(|load| [load.from_ms, load.until_ms])
            .chain((from_ms / NODE_MS + 1..=until_ms / NODE_MS).map(|node| node * NODE_MS))
            .chain([until_ms])
            .filter(|at_ms| (from_ms + 1..=until_ms).contains(at_ms))
            .collect();
        edges_ms.sort_unstable();
        edges_ms.dedup();
        let (mut at_ms, mut stored_j) = (from_ms, battery_j);
        let mut points = vec![(at_ms, stored_j)];
        let mut first = 0;
        for next_ms in edges_ms {
            let middle_ms = at_ms + (next_ms - at_ms) / 2;
            while loads.get(first).is_some_and(|load| load.until_ms <= at_ms) {
                first += 1;
            }
            let now = loads[first..].iter();
            let now = now.take_while(|load| load.from_ms <= middle_ms);
            let now = now.filter(|load| load.until_ms > middle_ms);
            let load_w: f64 = now.map(|load| load.power_w).sum();
            let net_w = self.flow_w(middle_ms, clean) - load_w;
            let gained_j = self.stored_j(net_w * (next_ms - at_ms) as f64 * 1e-3);
            stored_j = (stored_j + gained_j).clamp(0.0, self.capacity_j);
            points.push((next_ms, stored_j));
            at_ms = next_ms;
        }
        Profile { points }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn forecast() -> Forecast {
        let sky = Sky::new(-14.6, 270.0, 0.5).unwrap();
        Forecast::new(sky, 7.0 * 3600.0, &RoverModel::default(), 0.1, 0.85)
    }

    #[test]
    fn days_follow_each_other_and_the_sun_is_high_in_them() {
        let mut forecast = forecast();
        assert_eq!((forecast.sol_at(0), forecast.sol_at(88_775_244)), (0, 1));
        let mut before_ms = 0;
        for sol in 0..3 {
            let [opens_ms, closes_ms] = forecast.day_ms(sol).unwrap();
            assert!(before_ms <= opens_ms && closes_ms - opens_ms > 8 * 3_600_000);
            assert!(forecast.is_light(opens_ms) && !forecast.is_light(closes_ms));
            assert_eq!(
                (forecast.sol_at(opens_ms), forecast.sol_at(closes_ms)),
                (sol, sol)
            );
            before_ms = closes_ms;
        }
        // The dawn of the first sol was before the run.
        assert_eq!(forecast.day_ms(0).unwrap()[0], 0);
    }

    #[test]
    fn loads_take_what_they_take_and_the_battery_has_a_limit() {
        let mut forecast = forecast();
        let hour_ms = 3_600_000;
        let idle = forecast.profile(0, 1.0e6, 1.0, &[], 24 * hour_ms);
        let load = Load {
            from_ms: hour_ms,
            until_ms: 2 * hour_ms,
            power_w: 100.0,
        };
        let busy = forecast.profile(0, 1.0e6, 1.0, &[load], 24 * hour_ms);
        assert_eq!(idle.at_j(hour_ms), busy.at_j(hour_ms));
        let less_j = idle.at_j(2 * hour_ms) - busy.at_j(2 * hour_ms);
        assert!((0.9 * 360e3..=360e3).contains(&less_j), "{less_j}");
        // At night the charge falls, by day it rises, to no more than the battery holds.
        assert!(idle.at_j(23 * hour_ms) < idle.at_j(11 * hour_ms));
        let full = forecast.profile(0, 2.0e6, 1.0, &[], 4 * hour_ms);
        assert_eq!(full.at_j(4 * hour_ms), 2.0e6);
        let (at_ms, least_j) = busy.least_j(0, 4 * hour_ms).unwrap();
        assert!(busy.at_j(at_ms) == least_j && least_j <= busy.at_j(0));
        // Without a limit it gains what the profile gains.
        let gain_j = forecast.gain_j(0, 2 * hour_ms, 1.0);
        assert!(
            (gain_j - (idle.at_j(2 * hour_ms) - 1.0e6)).abs() < 1.0,
            "{gain_j}"
        );
        // A dusty array gives less.
        assert!(forecast.gain_j(0, 2 * hour_ms, 0.5) < gain_j);
    }
}
