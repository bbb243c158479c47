//! What a rover can do, and what it counts on when it plans.

use std::f64::consts::FRAC_PI_4;

use farside_actors::rover::RoverModel;

use crate::planner::objective::ObjectiveConfig;
use crate::survey::costs::Cost;
use crate::survey::execution::ExecutionConfig;

/// How much more driving is planned to take than on level ground.
const CLIMBS: f64 = 1.15;

/// What a rover can do, and what it counts on when it plans.
#[derive(Clone, Debug, PartialEq)]
pub struct Means {
    /// The side of the field \[m\].
    pub side_m: f64,
    /// How fast it gets on over a straight distance, rocks and turns considered \[mm/s\].
    pub speed_mm_s: u32,
    /// What driving takes beyond what the body takes \[W\].
    pub drive_power_w: f64,
    /// What the body takes \[W\].
    pub awake_power_w: f64,
    /// The charge below which no plan goes \[J\].
    pub reserve_j: f64,
    /// What the radio takes while it sends \[W\].
    pub radio_power_w: f64,
    /// How long the daily communication takes \[ms\]; 0 if there is none.
    pub communication_ms: i64,
    /// What the daily communication sends \[bit\].
    pub sends_bits: i64,
    /// When in the day it may begin and has to have ended \[s since local midnight\].
    pub communicates_s: [f64; 2],
    /// For how many sols it plans.
    pub horizon: u32,
    /// What counts besides what goals are worth.
    pub objective: ObjectiveConfig,
}

impl Means {
    /// Of a rover that keeps a share of its battery in reserve, on a square field on which rocks of
    /// these diameters \[m\] lie.
    pub fn new(
        rover: &RoverModel,
        config: &ExecutionConfig,
        reserve: f64,
        side_m: f64,
        diameters_m: impl Iterator<Item = f64>,
    ) -> Means {
        let covered_m2: f64 = diameters_m.map(|at_m| FRAC_PI_4 * at_m * at_m).sum();
        let slower = 1.0 + rover.rock_slowdown * covered_m2 / (side_m * side_m);
        let speed_mm_s = 1e3 * rover.speed_m_per_s / (slower * config.drive_margin);
        let communication_ms = (config.communication.as_nanos() / 1_000_000) as i64;
        Means {
            side_m,
            speed_mm_s: (speed_mm_s as u32).max(1),
            drive_power_w: CLIMBS * rover.drive_power_w,
            awake_power_w: rover.awake_power_w,
            reserve_j: reserve * rover.battery_j,
            radio_power_w: rover.radio_power_w,
            communication_ms,
            sends_bits: (i128::from(rover.radio_bit_per_s) * i128::from(communication_ms) / 1000)
                .min(1_000_000_000_000) as i64,
            communicates_s: [config.communicate_from, config.communicate_until]
                .map(|at| at.as_secs_f64()),
            horizon: config.horizon,
            objective: ObjectiveConfig::default(),
        }
    }

    /// The same for users who want this of plans besides.
    pub fn with_objective(mut self, objective: ObjectiveConfig) -> Means {
        self.objective = objective;
        self
    }

    /// What an observation takes beyond what the body takes \[W\].
    pub fn beyond_body_w(&self, cost: &Cost) -> f64 {
        (cost.power_w - self.awake_power_w).max(0.0)
    }

    /// How long a straight distance is planned to take \[ms\].
    pub fn drive_ms(&self, from_m: [f64; 2], to_m: [f64; 2]) -> i64 {
        let way_m = libm::hypot(to_m[0] - from_m[0], to_m[1] - from_m[1]);
        libm::ceil(way_m * 1e6 / f64::from(self.speed_mm_s)) as i64
    }
}
