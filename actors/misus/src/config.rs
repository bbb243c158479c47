//! What a scenario says of the team and of what it learns: `[world]`, `[team]`, `[learn]`; a rover's
//! hardware is `[rover]`, as [`farside_actors::rover`] declares it.

use farside::SimDuration;
use farside_actors::system::settings::{Within, if_set, in_unit, one_of, over, such_that};
use farside_actors::{settings, units};
use serde::{Deserialize, Serialize};

settings! {
    /// The `[world]` table: the ground, its rocks and the sky over it.
    pub struct FieldConfig {
        /// The story that laid the rocks: which class to expect where.
        pub story: String = "strata".to_owned(),
            one_of(&["strata", "ejecta", "lava", "outwash", "uniform"]);
        /// How many classes of rock there are, of those built in or of the library's; unless they are
        /// named or described.
        pub classes: u32 = 4, 1..=8;
        /// The classes by name, of those built in or of the library's.
        pub class_names: Vec<String> [skip_serializing_if = "Vec::is_empty"];
        /// Classes of one's own, in place of those built in; not with a library.
        pub own_classes as "class": Vec<ClassConfig> [skip_serializing_if = "Vec::is_empty"], Within;
        /// How many rocks there are: the largest to be expected at the abundance.
        pub rocks: u32 = 90, 1..=5_000;
        /// The side of the square field.
        pub side_m as "side": f64 [with = "units::length_m"] = 100.0, in_unit("m", 5.0..=2_000.0);
        /// The share of the ground that rocks cover (Golombek and Rapp's k).
        pub abundance: f64 [with = "units::fraction"] = 0.05, in_unit("of 1", 0.001..=1.0);
        /// How many hills there are.
        pub hills: u32 = 3, 0..=100;
        /// How high the highest hill is.
        pub hill_height_m as "hill_height": f64 [with = "units::length_m"] = 4.0,
            in_unit("m", 0.0..=500.0);
        /// A library of measured spectra in a CSV file, of which each rock has one; without, spectra
        /// are mixed from the absorption bands of minerals.
        pub spectra: Option<String> [skip_serializing_if = "Option::is_none"];
        /// Where on Mars it is, north is positive; Gusev crater unless given.
        pub latitude_rad as "latitude": f64 [with = "units::angle_rad"]
            = -14.6 * std::f64::consts::PI / 180.0, in_unit("rad", -1.571..=1.571);
        /// The season at the start: the Sun's longitude, 0 at the northern spring equinox.
        pub season_rad as "season": f64 [with = "units::angle_rad"]
            = 1.5 * std::f64::consts::PI, in_unit("rad", 0.0..=6.284);
        /// The optical depth of the dust in the air.
        pub dust: f64 = 0.5, 0.0..=10.0;
        /// The time of day at which the run starts, from local midnight.
        pub starts: SimDuration [with = "units::duration"] = SimDuration::from_secs(7 * 3600);
    }
}

settings! {
    /// A `[[world.class]]` entry: a class of rock of one's own. Fractions are by volume and sum to 1.
    pub struct ClassConfig {
        /// Its name.
        pub name: String, such_that("a name", |_| "missing".to_owned(), |name: &String| !name.is_empty());
        /// The mean fraction of olivine.
        pub olivine: f64 [with = "units::fraction"];
        /// The mean fraction of orthopyroxene.
        pub orthopyroxene: f64 [with = "units::fraction"];
        /// The mean fraction of clinopyroxene.
        pub clinopyroxene: f64 [with = "units::fraction"];
        /// The mean fraction of plagioclase.
        pub plagioclase: f64 [with = "units::fraction"];
        /// The mean fraction of hematite.
        pub hematite: f64 [with = "units::fraction"];
        /// The standard deviation of the logarithm of each fraction.
        pub scatter: f64 = 0.1, 0.0..=1.0;
        /// The median size of its grains.
        pub grain_m as "grain": f64 [with = "units::length_m"] = 2e-4, in_unit("m", 5e-6..=5e-3);
        /// The mean share of a rock's surface that dust covers.
        pub dust: f64 [with = "units::fraction"] = 0.1;
        /// The mean contrast of its texture: squared difference of neighbouring pixels, 0 to 1.
        pub contrast: f64 = 0.2, 0.0..=1.0;
        /// The mean energy of its texture: how even it is, 0 to 1.
        pub energy: f64 = 0.15, 0.0..=1.0;
        /// The mean correlation of neighbouring pixels, -1 to 1.
        pub correlation: f64 = 0.5, -1.0..=1.0;
        /// The mean anisotropy of its texture, 0 to 1.
        pub anisotropy: f64 = 0.1, 0.0..=1.0;
        /// The standard deviation of each statistic of texture.
        pub texture_scatter: f64 = 0.05, 0.0..=1.0;
    }
}

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
