//! The keys of a scenario's `[network.complete]` table.

use farside_actors::settings;

settings! {
    /// The `[network.complete]` table: what only the policy `complete` reads.
    pub struct CompleteConfig {
        /// Along how many routes a request looks for a path.
        pub routes: u32 = 8,
            1..=100;
    }
}
