//! What a scenario says of the team and of what it learns: `[team]`, `[learn]`; the ground is `[world]`, as
//! [`farside_actors::field`] declares it, a rover's hardware `[rover]`, as [`farside_actors::rover`] does.

use farside::SimDuration;
use farside_actors::system::settings::{if_set, in_unit, one_of, over};
use farside_actors::{settings, units};
use serde::{Deserialize, Serialize};

settings! {
    /// The `[team]` table: how many rovers.
    pub struct TeamConfig {
        /// How many rovers there are. They start side by side in the middle of the field.
        pub rovers: u32 = 3, 1..=50;
    }
}

/// Which rock a rover goes to next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Tour {
    /// The nearest that it has not been to: a fixed tour, whatever it learns.
    #[default]
    Fixed,
    /// Any that it has not been to, drawn from the seed.
    Random,
    /// The one that the prioritiser values most, by what the rover knows then.
    Prioritised,
}

/// What a team wants to find out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Objective {
    /// The distribution of rock classes over the field: the paper's (section 2).
    #[default]
    Distribution,
    /// The rock that is richest in one mineral.
    Mineral,
    /// Which story laid the field.
    Process,
}

settings! {
    /// The `[learn]` table: tours, readings, what is learnt of them and when it is exchanged.
    pub struct LearnConfig {
        /// What the team wants to find out.
        pub objective: Objective, one_of(&["distribution", "mineral", "process"]);
        /// The mineral whose richest rock rovers name, and look for with `objective = "mineral"`.
        pub mineral: String = "olivine".to_owned();
        /// Which rock a rover goes to next, of those in its own sector of the field.
        pub tour: Tour, one_of(&["fixed", "random", "prioritised"]);
        /// How far from the edge of a rock a rover stops to read it.
        pub stand_off_m as "stand_off": f64 [with = "units::length_m"] = 1.5,
            in_unit("m", 0.3..=50.0);
        /// How many rocks each rover reads from near before its tour is over; all of its sector unless
        /// given.
        pub stops: Option<u32> [skip_serializing_if = "Option::is_none"], if_set(0..=5_000);
        /// How many rocks lie between two panoramic images, which correct where a rover believes to
        /// be; with 0 there are none.
        pub panorama_every: u32 = 4, 0..=1_000;
        /// The time from one exchange of readings to the next.
        pub exchange_every: SimDuration [with = "units::duration"] = SimDuration::from_secs(1800),
            over(SimDuration::ZERO);
        /// The share of each sol, around noon, in which rovers exchange.
        pub contact: f64 [with = "units::fraction"] = 1.0;
        /// The time from one lesson to the next: what was read and heard since is learnt from then. On
        /// prioritised tours it is before every choice, too.
        pub learn_every: SimDuration [with = "units::duration"] = SimDuration::from_secs(4 * 3600),
            over(SimDuration::ZERO);
        /// Whether a rover learns at each rock that it has read, too: what `field_ari_area` and its like
        /// are measured by.
        pub learn_at_stops: bool;
        /// The most classes that are told apart.
        pub max_classes: u32 = 8, 1..=20;
        /// Below this share of its battery a rover rests.
        pub reserve: f64 [with = "units::fraction"] = 0.45;
        /// Below this elevation of the Sun a rover sleeps.
        pub sun_least_rad as "sun_least": f64 [with = "units::angle_rad"] = 0.1,
            in_unit("rad", -0.5..=1.0);
    }
}
