//! The bay with a rover's electronics: how warm it is. It knows no commands, and of electricity only
//! what turns into heat.
//!
//! The bay is one heat capacity that loses heat to the air in proportion to the difference, more of
//! it while fans run. Heat is linear in time between two calls, and the air's temperature a cosine of
//! the sol, so that what the bay does between them has a closed form: it does not matter when one
//! looks.

use std::f64::consts::TAU;

use farside_worlds::sky::SOL_S;

use crate::system::settings::in_unit;
use crate::{settings, units};

/// 0 °C \[K\].
const ZERO_C_K: f64 = 273.15;

/// The share of the sol after midnight at which air is warmest: at 14 h of 24.
const WARMEST: f64 = 14.0 / 24.0;

settings! {
    /// The `[rover.bay]` table: the bay with the electronics, and its fans.
    ///
    /// ```
    /// use farside_actors::rover::RoverConfig;
    /// let text = "model = 'k9'\nbay = { start = '40degC', fan_power = '8W' }";
    /// let rover: RoverConfig = toml::from_str(text)?;
    /// assert_eq!((rover.bay.start_k, rover.bay.fan_power_w), (313.15, 8.0));
    /// // What is not given is the model's.
    /// assert_eq!(rover.bay.heat_capacity_j_per_k, 8000.0);
    /// # Ok::<(), toml::de::Error>(())
    /// ```
    pub struct BayModel {
        /// The heat that warms the bay by one kelvin \[J/K\].
        pub heat_capacity_j_per_k: f64 = 25_000.0, in_unit("J/K", 1.0..=1e9);
        /// The heat that the bay loses for each kelvin that it is warmer than the air \[W/K\].
        pub conductance_w_per_k: f64 = 0.35, in_unit("W/K", 0.001..=10_000.0);
        /// What fans add to that while they run \[W/K\]; with 0 the rover has no fans.
        pub fan_conductance_w_per_k: f64 = 0.0, in_unit("W/K", 0.0..=10_000.0);
        /// What fans take while they run.
        pub fan_power_w as "fan_power": f64 [with = "units::power_w"] = 5.0,
            in_unit("W", 0.0..=10_000.0);
        /// The share of what the body, the radio, the heater, the fans and faults take that becomes
        /// heat in the bay. Of what wheels, mast and instruments take, none does.
        pub heat_share: f64 [with = "units::fraction"] = 0.9;
        /// How warm it is at the start.
        pub start_k as "start": f64 [with = "units::temperature_k"] = 283.15,
            in_unit("K", 100.0..=500.0);
        /// The standard deviation of its temperature as measured \[K\].
        pub sigma_k: f64 = 0.3, in_unit("K", 0.0..=50.0);
        /// The air at its coldest, two hours after midnight.
        pub air_low_k as "air_low": f64 [with = "units::temperature_k"] = 197.0,
            in_unit("K", 100.0..=500.0);
        /// The air at its warmest, two hours after noon. In between it follows a cosine.
        pub air_high_k as "air_high": f64 [with = "units::temperature_k"] = 263.0,
            in_unit("K", 100.0..=500.0);
    }
}

/// The bay.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bay {
    heat_capacity_j_per_k: f64,
    conductance_w_per_k: f64,
    /// With what fans add to it.
    fans_conductance_w_per_k: f64,
    heat_share: f64,
    air_mean_c: f64,
    air_swing_k: f64,
    /// The sky's time at the start of the run \[s\].
    starts_s: f64,
    bay_c: f64,
    fans_run: bool,
    /// Heat of faults, which nothing electric takes \[W\].
    fault_w: f64,
}

impl Bay {
    pub(super) fn new(model: &BayModel, starts_s: f64) -> Bay {
        Bay {
            heat_capacity_j_per_k: model.heat_capacity_j_per_k,
            conductance_w_per_k: model.conductance_w_per_k,
            fans_conductance_w_per_k: model.conductance_w_per_k + model.fan_conductance_w_per_k,
            heat_share: model.heat_share,
            air_mean_c: 0.5 * (model.air_low_k + model.air_high_k) - ZERO_C_K,
            air_swing_k: 0.5 * (model.air_high_k - model.air_low_k),
            starts_s,
            bay_c: model.start_k - ZERO_C_K,
            fans_run: false,
            fault_w: 0.0,
        }
    }

    /// How warm it is \[°C\].
    pub(super) fn bay_c(&self) -> f64 {
        self.bay_c
    }

    pub(super) fn fans_run(&self) -> bool {
        self.fans_run
    }

    /// Sets what holds from now on: whether fans run, and the heat of faults \[W\].
    pub(super) fn set(&mut self, fans_run: bool, fault_w: f64) {
        self.fans_run = fans_run;
        self.fault_w = fault_w;
    }

    /// Lets a time pass that begins and ends at these seconds of the run, while loads inside take
    /// power that goes in a straight line from one value to another \[W\].
    pub(super) fn pass(&mut self, from_s: f64, to_s: f64, inside_w: [f64; 2]) {
        let lasts_s = to_s - from_s;
        if lasts_s <= 0.0 {
            return;
        }
        let conductance = match self.fans_run {
            true => self.fans_conductance_w_per_k,
            false => self.conductance_w_per_k,
        };
        let slow_s = self.heat_capacity_j_per_k / conductance;
        // How much warmer it would come to be than the air if the power stayed.
        let warmer_k = inside_w.map(|power| (self.heat_share * power + self.fault_w) / conductance);
        let gone = -libm::expm1(-lasts_s / slow_s);
        let before_k = self.bay_c - self.follows_c(from_s, slow_s);
        let after_k = before_k
            + (warmer_k[0] - before_k) * gone
            + (warmer_k[1] - warmer_k[0]) * (1.0 - slow_s / lasts_s * gone);
        self.bay_c = self.follows_c(to_s, slow_s) + after_k;
    }

    /// How warm a bay without heat of its own is that has followed the air for ever with a time
    /// constant \[°C\]: later than the air and less.
    fn follows_c(&self, at_s: f64, slow_s: f64) -> f64 {
        let turn_per_s = TAU / SOL_S;
        let lag = turn_per_s * slow_s;
        let angle = turn_per_s * (self.starts_s + at_s) - TAU * WARMEST;
        let (sine, cosine) = libm::sincos(angle);
        self.air_mean_c + self.air_swing_k * (cosine + lag * sine) / (1.0 + lag * lag)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn bay(starts_s: f64) -> Bay {
        Bay::new(&BayModel::default(), starts_s)
    }

    /// The air as the table says it \[°C\].
    fn air_c(at_s: f64) -> f64 {
        let hour = at_s / SOL_S * 24.0;
        -43.15 + 33.0 * libm::cos((hour - 14.0) / 24.0 * TAU)
    }

    #[test]
    fn without_power_it_follows_the_air_later_and_less() {
        let mut one = bay(0.0);
        let mut warmest = (0.0, f64::MIN);
        let mut coldest_c = f64::MAX;
        for minute in 0..20 * 1480 {
            let from_s = f64::from(minute) * 60.0;
            one.pass(from_s, from_s + 60.0, [0.0; 2]);
            // The last sol of twenty.
            if minute >= 19 * 1480 {
                coldest_c = one.bay_c().min(coldest_c);
                if one.bay_c() > warmest.1 {
                    warmest = (from_s, one.bay_c());
                }
            }
        }
        let hour = (warmest.0 / SOL_S).fract() * 24.0;
        assert!((18.0..20.0).contains(&hour), "warmest at {hour} h");
        assert!(warmest.1 < -10.15 && coldest_c > -76.15);
        assert!((0.5 * (warmest.1 + coldest_c) + 43.15).abs() < 0.1);
    }

    #[test]
    fn with_power_it_comes_to_a_balance_and_fans_lower_it() {
        let model = BayModel {
            air_low_k: 273.15,
            air_high_k: 273.15,
            fan_conductance_w_per_k: 0.65,
            ..BayModel::default()
        };
        let mut one = Bay::new(&model, 0.0);
        one.pass(0.0, 1e7, [20.0; 2]);
        assert!((one.bay_c() - 0.9 * 20.0 / 0.35).abs() < 1e-9);
        one.set(true, 0.0);
        one.pass(1e7, 2e7, [20.0; 2]);
        assert!((one.bay_c() - 18.0).abs() < 1e-9);
        // Heat of a fault comes in full.
        one.set(true, 10.0);
        one.pass(2e7, 3e7, [20.0; 2]);
        assert!((one.bay_c() - 28.0).abs() < 1e-9);
    }

    proptest! {
        /// Against Runge and Kutta's steps of the equation itself.
        #[test]
        fn it_does_what_small_steps_do(
            starts_s in 0.0..SOL_S,
            stretches in prop::collection::vec((1.0..20_000.0f64, -50.0..50.0f64, any::<bool>()), 1..8),
        ) {
            let model = BayModel { fan_conductance_w_per_k: 2.0, ..BayModel::default() };
            let mut one = Bay::new(&model, starts_s);
            let (mut now_s, mut stepped_c, mut power_w) = (0.0, 10.0, 30.0f64);
            for (lasts_s, change_w, fans_run) in stretches {
                let end_w = (power_w + change_w).max(0.0);
                one.set(fans_run, 3.0);
                one.pass(now_s, now_s + lasts_s, [power_w, end_w]);
                let conductance = if fans_run { 2.35 } else { 0.35 };
                let rate = |at_s: f64, at_c: f64| {
                    let inside_w = power_w + (end_w - power_w) * (at_s - now_s) / lasts_s;
                    let lost_w = conductance * (at_c - air_c(starts_s + at_s));
                    (0.9 * inside_w + 3.0 - lost_w) / 25_000.0
                };
                let steps = libm::ceil(lasts_s / 50.0);
                let step_s = lasts_s / steps;
                for step in 0..steps as u32 {
                    let at_s = now_s + f64::from(step) * step_s;
                    let first = rate(at_s, stepped_c);
                    let second = rate(at_s + 0.5 * step_s, stepped_c + 0.5 * step_s * first);
                    let third = rate(at_s + 0.5 * step_s, stepped_c + 0.5 * step_s * second);
                    let fourth = rate(at_s + step_s, stepped_c + step_s * third);
                    stepped_c += step_s / 6.0 * (first + 2.0 * (second + third) + fourth);
                }
                (now_s, power_w) = (now_s + lasts_s, end_w);
                prop_assert!((one.bay_c() - stepped_c).abs() < 1e-6, "{} {stepped_c}", one.bay_c());
            }
        }

        /// Looking in between changes nothing but the last digits.
        #[test]
        fn looking_changes_nothing(
            starts_s in 0.0..SOL_S,
            lasts_s in 0.001..50_000.0f64,
            looks in prop::collection::vec(0.0..1.0f64, 0..20),
            power_w in 0.0..200.0f64,
            end_w in 0.0..200.0f64,
        ) {
            let mut whole = bay(starts_s);
            whole.pass(0.0, lasts_s, [power_w, end_w]);
            let mut looks = looks;
            looks.sort_by(f64::total_cmp);
            looks.push(1.0);
            let (mut parts, mut now_s) = (bay(starts_s), 0.0);
            let at_w = |at_s: f64| power_w + (end_w - power_w) * at_s / lasts_s;
            for look in looks {
                let to_s = look * lasts_s;
                parts.pass(now_s, to_s, [at_w(now_s), at_w(to_s)]);
                now_s = to_s;
            }
            prop_assert!((whole.bay_c() - parts.bay_c()).abs() < 1e-8);
        }
    }
}
