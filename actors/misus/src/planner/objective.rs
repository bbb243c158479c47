//! What counts besides Equation 1: the user's preferences, as CASPER's generic ones (the paper's section 3.1, and
//! G. Rabideau, B. Engelhardt and S. Chien, *Using Generic Preferences to Incrementally Improve Plan Quality*, 2000).

use farside_actors::settings;

settings! {
    /// The `[objective]` table: what a plan is worth less for, in the unit of goals' weights. With nothing said it is
    /// the paper's Equation 1, the weights of goals and combinations alone. Drives and goals are counted, the daily
    /// communication is not.
    pub struct ObjectiveConfig {
        /// For each metre that is driven.
        pub drive_per_m: f64 = 0.0, 0.0..=1e6;
        /// For each kilojoule that drives and goals take.
        pub energy_per_kj: f64 = 0.0, 0.0..=1e6;
        /// For each hour that drives and goals take.
        pub busy_per_h: f64 = 0.0, 0.0..=1e6;
    }
}

impl ObjectiveConfig {
    /// Whether it is Equation 1 alone.
    pub fn is_plain(&self) -> bool {
        *self == ObjectiveConfig::default()
    }

    /// What so much time \[ms\] at so much power \[mW\] takes from a plan's worth.
    pub fn effort(&self, duration_ms: i64, power_mw: f64) -> f64 {
        let ms = duration_ms as f64;
        ms * (self.busy_per_h / 3.6e6 + power_mw * self.energy_per_kj * 1e-9)
    }

    /// What a drive takes from a plan's worth.
    pub fn drive(&self, length_m: f64, duration_ms: i64, power_mw: f64) -> f64 {
        length_m * self.drive_per_m + self.effort(duration_ms, power_mw)
    }
}

/// The preferences of a problem, by goal and by rover.
///
/// ```
/// use farside_misus::planner::instance::Instance;
/// use farside_misus::planner::objective::ObjectiveConfig;
/// use farside_misus::planner::problem::{ProblemConfig, generate};
/// let mut problem = generate(&ProblemConfig::default(), 1)?;
/// assert_eq!(Instance::new(&problem)?.costs().of_goal(0), 0.0);
/// problem.objective = ObjectiveConfig { busy_per_h: 3.0, ..ObjectiveConfig::default() };
/// // A long-range image takes 20 minutes.
/// assert!((Instance::new(&problem)?.costs().of_goal(0) - 1.0).abs() < 1e-12);
/// # Ok::<(), farside_misus::planner::problem::ProblemError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Costs {
    is_plain: bool,
    goals: Vec<f64>,
    /// By rover, for each millisecond of driving.
    drives: Vec<f64>,
}

impl Costs {
    /// Of goals with duration \[ms\] and energy \[uJ\], and rovers with speed \[mm/s\] and power \[mW\].
    pub(super) fn new(
        objective: &ObjectiveConfig,
        goals: impl Iterator<Item = (i64, i64)>,
        rovers: impl Iterator<Item = (u32, i64)>,
    ) -> Costs {
        let of_goal = |(duration_ms, energy_uj): (i64, i64)| {
            objective.effort(duration_ms, 0.0) + energy_uj as f64 * 1e-9 * objective.energy_per_kj
        };
        let of_drive = |(speed_mm_s, power_mw): (u32, i64)| {
            objective.drive(f64::from(speed_mm_s) * 1e-6, 1, power_mw as f64)
        };
        Costs {
            is_plain: objective.is_plain(),
            goals: goals.map(of_goal).collect(),
            drives: rovers.map(of_drive).collect(),
        }
    }

    /// Whether nothing costs anything.
    pub fn is_plain(&self) -> bool {
        self.is_plain
    }

    /// What a goal costs, the drive to it not included.
    pub fn of_goal(&self, goal: usize) -> f64 {
        self.goals[goal]
    }

    /// What so much driving of a rover costs \[ms\].
    pub fn of_drive(&self, rover: usize, duration_ms: i64) -> f64 {
        self.drives[rover] * duration_ms as f64
    }
}
