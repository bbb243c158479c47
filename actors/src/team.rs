//! The keys of a scenario's `[team]` table: who drives. Any system with rovers reads it.

use crate::settings;

/// The most rovers: each has a link to and from each other host, and memory is finite.
const MAX_ROVERS: u32 = 10_000;

settings! {
    /// The `[team]` table: who drives.
    ///
    /// ```
    /// use farside_actors::system::settings::Table;
    /// use farside_actors::team::TeamConfig;
    /// assert_eq!(TeamConfig::default().rovers, 50);
    /// let error = TeamConfig::of(0).check("team").unwrap_err();
    /// assert_eq!(error.to_string(), "team.rovers: 0: expected 1 to 10000");
    /// ```
    pub struct TeamConfig {
        /// How many rovers there are. In the system `network` all wait at their entries at the
        /// start; where its world has tasks, they do the first ones.
        pub rovers: u32 = 50,
            1..=MAX_ROVERS;
        /// The names of the rovers that take part, such as `rover_07`; all unless given. The others
        /// are not there at all, and those that are have the names, entries and goals that they
        /// have in the whole team.
        pub only: Vec<String> [skip_serializing_if = "Vec::is_empty"];
    }
}

impl TeamConfig {
    /// A team of so many rovers.
    pub fn of(rovers: u32) -> Self {
        TeamConfig {
            rovers,
            ..TeamConfig::default()
        }
    }
}
