//! How rovers carry plans out, and when they make others: the `[execution]` table.

use farside::SimDuration;
use farside_actors::system::SetupError;
use farside_actors::system::settings::{Table, in_unit, one_of, over};
use farside_actors::{settings, units};

use super::messages::PlanMode;

settings! {
    /// The `[execution]` table: how rovers carry out their plans, and when they plan anew.
    pub struct ExecutionConfig {
        /// Whether a rover's next plan is made from the plan that it has (`continuous`) or from nothing
        /// (`batch`).
        pub mode: PlanMode, one_of(&["continuous", "batch"]);
        /// What begins within this time is not planned anew: a new plan begins with it.
        pub commit_window: SimDuration [with = "units::duration"] = SimDuration::from_secs(120);
        /// An activity that ends earlier or later than planned by more than this is a reason to plan
        /// anew.
        pub late_tolerance: SimDuration [with = "units::duration"] = SimDuration::from_secs(120),
            over(SimDuration::ZERO);
        /// How often a rover tries an activity again that has failed.
        pub retries: u32 = 3, 0..=100;
        /// How long it waits before it tries again.
        pub retry_after: SimDuration [with = "units::duration"] = SimDuration::from_secs(600);
        /// For how many sols a rover plans, the present one among them.
        pub horizon: u32 = 2, 1..=20;
        /// How many times as long as through rocks at the mean abundance a drive is planned to take: the
        /// way is no straight line.
        pub drive_margin: f64 = 1.3, 1.0..=20.0;
        /// The share of the sunlight to be expected that plans count on.
        pub sun_share: f64 [with = "units::fraction"] = 0.85, in_unit("of 1", 0.0..=1.0);
        /// From when on the daily communication may begin, from local midnight.
        pub communicate_from: SimDuration [with = "units::duration"] = SimDuration::from_secs(13 * 3600);
        /// When the daily communication has to have ended, from local midnight.
        pub communicate_until: SimDuration [with = "units::duration"] = SimDuration::from_secs(16 * 3600);
        /// How long the daily communication takes; with 0 s there is none.
        pub communication: SimDuration [with = "units::duration"] = SimDuration::from_secs(600);
        /// How often a rover at the least looks at its battery, its memory and where it believes to be.
        pub update_every: SimDuration [with = "units::duration"] = SimDuration::from_secs(600),
            over(SimDuration::ZERO);
    }
}

impl ExecutionConfig {
    /// Checks values beside each other.
    ///
    /// # Errors
    /// When the daily communication does not fit into its window.
    pub fn check_together(&self, name: &str) -> Result<(), SetupError> {
        self.check(name)?;
        let (from, until) = (self.communicate_from, self.communicate_until);
        if from + self.communication <= until {
            return Ok(());
        }
        let (lasts, key) = (self.communication, format!("{name}.communicate_until"));
        let message = format!("{until}: expected {lasts} or more after {from}");
        Err(SetupError::value(&key, message))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_communication_that_does_not_fit_its_window_is_refused() {
        assert!(
            ExecutionConfig::default()
                .check_together("execution")
                .is_ok()
        );
        let wrong = ExecutionConfig {
            communicate_until: SimDuration::from_secs(13 * 3600),
            ..ExecutionConfig::default()
        };
        let error = wrong.check_together("execution").unwrap_err().to_string();
        assert_eq!(
            error,
            "execution.communicate_until: 46800s: expected 600s or more after 46800s"
        );
    }
}
