//! What a scenario says of agents and goals: `[agents]`, `[mission_agent]`, `[system_agent]`, `[deliberation]`, `[relay]`,
//! `[goals]` and `[[goal]]`. The ground is `[world]`, as [`farside_actors::field`] declares it; the hardware is
//! `[rover]`, as [`farside_actors::rover`] does.

use farside::SimDuration;
use farside_actors::field::FieldConfig;
use farside_actors::processor::Speed;
use farside_actors::rover::RoverConfig;
use farside_actors::system::settings::{in_unit, one_of, over};
use farside_actors::{settings, units};
use serde::{Deserialize, Serialize};

/// The cameras of a K9, as its models name them.
pub(crate) const CAMERAS: [&str; 4] = ["wide_eye", "hawk_eye", "haz_front", "haz_rear"];

settings! {
    /// The `[agents]` table: who controls whom.
    pub struct AgentsConfig {
        /// How many rovers there are, each with its own agents and relay. The hosts of one are called
        /// `mission`, `system` and `k9`; of several `mission_01`, `system_01`, `k9_01` and so on.
        pub rovers: u32 = 1, 1..=50;
        /// How many agents there are in a row above a relay: 1 is the system agent alone, which the
        /// ground commands; 2 is the paper's, with a mission agent above it; each one more hands goals
        /// on between those two.
        pub layers: u32 = 2, 1..=6;
        /// How long what was sent and not acknowledged waits until it is sent again for the first time;
        /// then twice as long each time.
        pub repeat_after: SimDuration [with = "units::duration"] = SimDuration::from_secs(4),
            over(SimDuration::ZERO);
        /// At most so long.
        pub repeat_at_most: SimDuration [with = "units::duration"] = SimDuration::from_secs(60),
            over(SimDuration::ZERO);
        /// Whether the run ends when all goals are achieved.
        pub stop_when_done: bool = true;
    }
}

/// What an agent plans with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Technology {
    /// Tokens in a plan database, tied by times and values; a chronological search.
    #[default]
    Temporal,
    /// Ground predicates and counters, one tick at a time.
    Propositional,
    /// A table of states and what follows them, made of the model.
    Compiled,
}

settings! {
    /// An agent: `[mission_agent]`, `[system_agent]`.
    pub struct AgentConfig {
        /// Its model: one that is built in, or a file; the K9's of its place unless given.
        pub model: Option<String> [skip_serializing_if = "Option::is_none"];
        /// What it plans with.
        pub technology: Technology, one_of(&["temporal", "propositional", "compiled"]);
        /// Its latency: how long a tick is. Models count in ticks.
        pub latency: SimDuration [with = "units::duration"] = SimDuration::from_millis(500),
            over(SimDuration::ZERO);
        /// How many ticks ahead it plans in each cycle.
        pub horizon: u32 = 1, 1..=1000;
        /// Whether it guesses what others will answer where it plans further ahead than it must.
        pub guess: bool;
        /// How fast its host's processor is. A cycle's decisions leave when its operations are done.
        pub processor: Speed = Speed::PerS(20_000);
        /// What a cycle takes beside planning \[operations\].
        pub overhead: u64 = 200, 0..=1_000_000_000;
        /// A cycle that takes more operations than this is aborted.
        pub budget: u64 = 100_000, 1..=1_000_000_000_000;
        /// So many cycles in a row may be aborted: with one more the agent is faulty.
        pub aborts: u32 = 2, 0..=1_000_000;
        /// Whether the past is deleted after each cycle (section 4 of the paper).
        pub deletes: bool = true;
        /// Whether every edit is propagated through all that is known, not only through what it
        /// changes.
        pub propagates_all: bool;
        /// Whether all tokens that are known are searched for one that fulfils a relation, not only
        /// the last ones.
        pub searches_all: bool;
        /// After so long without a word from whom it controls, or from who controls it, their contracts
        /// are faulted; with 0 s, never.
        pub lease: SimDuration [with = "units::duration"];
        /// After so long a faulty agent begins anew; with 0 s, never.
        pub restart_after: SimDuration [with = "units::duration"];
    }
}

settings! {
    /// The `[deliberation]` table: how a mission agent orders its goals.
    pub struct DeliberationConfig {
        /// After so many attempts a goal is given up.
        pub attempts: u32 = 3, 1..=1000;
        /// How many operations it may take each time.
        pub budget: u64 = 20_000_000, 1..=1_000_000_000_000;
        /// Up to so many goals the best order is proven; beyond, it is the best that repair finds.
        pub few: u32 = 6, 0..=12;
        /// How fast it thinks the rover drives.
        pub speed_m_per_s as "speed": f64 [with = "units::speed_m_per_s"] = 0.1,
            in_unit("m/s", 1e-3..=10.0);
        /// What it thinks a drive takes, as a share of the battery for each metre.
        pub drive_per_m: f64 = 0.0016, in_unit("of the battery a metre", 0.0..=1.0);
        /// How much of the battery it thinks has to stay.
        pub reserve: f64 [with = "units::fraction"] = 0.2;
    }
}

settings! {
    /// The `[relay]` table: what turns goals into commands of the hardware.
    pub struct RelayConfig {
        /// After so long without a word from the system agent it stops the rover; with 0 s, never.
        pub lease: SimDuration [with = "units::duration"] = SimDuration::from_secs(3);
        /// A file that says which goal is which command, for models of one's own; the K9's unless
        /// given.
        pub table: Option<String> [skip_serializing_if = "Option::is_none"];
    }
}

settings! {
    /// The `[goals]` table: goals by chance, where no `[[goal]]` is given.
    pub struct GoalsConfig {
        /// How many for each rover.
        pub count: u32 = 5, 0..=1000;
        /// They lie at most so far from where the rover starts.
        pub within_m as "within": f64 [with = "units::length_m"] = 20.0, in_unit("m", 1.0..=1000.0);
    }
}

settings! {
    /// A `[[goal]]` entry: an image from a place.
    pub struct GoalConfig {
        /// Its name; numbered unless given.
        pub name: String;
        /// Whose it is: the host of a relay, or a pattern over them.
        pub rover: String = "*".to_owned();
        /// To the east of where the rover starts; rounded to decimetres.
        pub east_m as "east": f64 [with = "units::signed_length_m"], in_unit("m", -10_000.0..=10_000.0);
        /// To the north of where the rover starts; rounded to decimetres.
        pub north_m as "north": f64 [with = "units::signed_length_m"], in_unit("m", -10_000.0..=10_000.0);
        /// Where the mast points, from straight ahead to the left; rounded to degrees.
        pub pan_rad as "pan": f64 [with = "units::angle_rad"], in_unit("rad", -6.3..=6.3);
        /// Where the mast points, from level upwards; rounded to degrees.
        pub tilt_rad as "tilt": f64 [with = "units::angle_rad"], in_unit("rad", -1.6..=1.6);
        /// With which camera.
        pub camera: String = "wide_eye".to_owned(), one_of(&CAMERAS);
        /// When the ground sends it.
        pub at: SimDuration [with = "units::duration"];
        /// When the ground takes it back, if it does; only where a mission agent orders goals.
        pub recalled: Option<SimDuration>
            [with = "units::duration::option", skip_serializing_if = "Option::is_none"];
        /// What it is worth beside others, where not all can be done; 0: it must be done.
        pub weight: u32 = 0, 0..=1_000_000;
    }
}

/// The tables that an IDEA scenario has.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct IdeaScenario {
    pub(crate) world: FieldConfig,
    pub(crate) rover: RoverConfig,
    pub(crate) agents: AgentsConfig,
    pub(crate) mission_agent: AgentConfig,
    pub(crate) system_agent: AgentConfig,
    pub(crate) deliberation: DeliberationConfig,
    pub(crate) relay: RelayConfig,
    pub(crate) goals: GoalsConfig,
    #[serde(rename = "goal", skip_serializing_if = "Vec::is_empty")]
    pub(crate) goal: Vec<GoalConfig>,
}
