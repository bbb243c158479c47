//! Faults of rovers: at times of one's own choice, and by chance. Each is told to the hardware as a
//! control event, at its beginning and at its end, and so is in the log by its name. No fault ends
//! a run.

use farside::random::RandomKey;
use farside::{Pattern, SimDuration, SimTime};
use farside_worlds::sky::SOL_S;
use serde::{Deserialize, Serialize};

use super::lifts::{SIDES, USUAL_SIDE};
use crate::system::SetupError;
use crate::system::settings::{if_set, in_unit, one_of, over};
use crate::{settings, units};

/// The most faults by chance that one rover may have in a run.
const MAX_BY_CHANCE: usize = 10_000;

/// What goes wrong.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FaultKind {
    /// Something lies ahead of the rover that nobody knew of: a disc, half a metre away.
    #[default]
    BlockedPath,
    /// The wheels slip more.
    Slip,
    /// Commands that begin meanwhile take a share of their time.
    EndsEarly,
    /// Commands that begin meanwhile take more than their time.
    EndsLate,
    /// Commands that begin meanwhile do not end by themselves.
    NeverEnds,
    /// Something takes power.
    ExtraPower,
    /// Dust lies on the solar array.
    Dust,
    /// An instrument does nothing. What it is at fails at once.
    InstrumentFails,
    /// An instrument measures too much.
    InstrumentDrifts,
    /// A share of the memory is out of order. What does not fit into the rest is lost.
    Memory,
    /// The mast does not move. A slew that is under way fails at once.
    StuckMast,
    /// A rock is under the wheels of a side or a corner. It tilts the rover, in truth, until its
    /// wheels have gone a distance, whichever way: backing up less than that does not help.
    RockUnderWheel,
    /// The inertial unit measures the pitch wrongly.
    PitchBias,
    /// The inertial unit measures the roll wrongly.
    RollBias,
    /// Something heats the bay that is not of the rover's electricity.
    BayHeat,
    /// The fans stand still, whatever they are told: nothing measures whether they run.
    FansFail,
}

impl FaultKind {
    /// All kinds.
    pub const ALL: [FaultKind; 16] = [
        FaultKind::BlockedPath,
        FaultKind::Slip,
        FaultKind::EndsEarly,
        FaultKind::EndsLate,
        FaultKind::NeverEnds,
        FaultKind::ExtraPower,
        FaultKind::Dust,
        FaultKind::InstrumentFails,
        FaultKind::InstrumentDrifts,
        FaultKind::Memory,
        FaultKind::StuckMast,
        FaultKind::RockUnderWheel,
        FaultKind::PitchBias,
        FaultKind::RollBias,
        FaultKind::BayHeat,
        FaultKind::FansFail,
    ];

    /// Its name in scenarios.
    pub fn name(self) -> &'static str {
        NAMES[self as usize]
    }

    /// Which parts it can be of.
    fn parts(self) -> PartsOf {
        match self {
            FaultKind::EndsEarly | FaultKind::EndsLate | FaultKind::NeverEnds => PartsOf::All,
            FaultKind::InstrumentFails | FaultKind::InstrumentDrifts => PartsOf::Instruments,
            FaultKind::RockUnderWheel => PartsOf::Sides,
            _ => PartsOf::None,
        }
    }

    /// How far a rover drives until it is over it \[m\], unless it is given; none for those that no
    /// driving ends.
    fn distance_m(self) -> Option<f64> {
        (self == FaultKind::RockUnderWheel).then_some(1.0)
    }

    /// What its amount is unless it is given, and between what it may be; none for those that have
    /// no amount.
    fn amount(self) -> Option<[f64; 3]> {
        match self {
            FaultKind::BlockedPath => Some([1.0, 0.01, 100.0]),
            FaultKind::Slip => Some([0.4, 0.0, 0.95]),
            FaultKind::EndsEarly => Some([0.5, 0.01, 1.0]),
            FaultKind::EndsLate => Some([2.0, 1.0, 1000.0]),
            FaultKind::ExtraPower => Some([20.0, 0.0, 10_000.0]),
            FaultKind::Dust => Some([0.3, 0.0, 1.0]),
            FaultKind::InstrumentDrifts => Some([0.05, -10.0, 10.0]),
            FaultKind::Memory => Some([0.25, 0.0, 1.0]),
            FaultKind::RockUnderWheel => Some([0.3, 0.01, 2.0]),
            FaultKind::PitchBias | FaultKind::RollBias => Some([0.6, -1.5, 1.5]),
            FaultKind::BayHeat => Some([100.0, 0.0, 10_000.0]),
            FaultKind::NeverEnds
            | FaultKind::InstrumentFails
            | FaultKind::StuckMast
            | FaultKind::FansFail => None,
        }
    }
}

/// Which parts a kind of fault can be of.
#[derive(Clone, Copy, PartialEq, Eq)]
enum PartsOf {
    All,
    Instruments,
    /// Sides and corners of the rover.
    Sides,
    None,
}

/// The names, in the order of [`FaultKind::ALL`].
const NAMES: [&str; 16] = [
    "blocked-path",
    "slip",
    "ends-early",
    "ends-late",
    "never-ends",
    "extra-power",
    "dust",
    "instrument-fails",
    "instrument-drifts",
    "memory",
    "stuck-mast",
    "rock-under-wheel",
    "pitch-bias",
    "roll-bias",
    "bay-heat",
    "fans-fail",
];

settings! {
    /// A `[[rover.fault]]` entry: a fault at a time of one's own choice.
    ///
    /// | kind | amount | default | range |
    /// |---|---|---|---|
    /// | `blocked-path` | radius of what lies ahead \[m\] | 1 | 0.01 to 100 |
    /// | `slip` | slip, beyond what there is anyway | 0.4 | 0 to 0.95 |
    /// | `ends-early` | share of the time that commands take | 0.5 | 0.01 to 1 |
    /// | `ends-late` | how many times the time that commands take | 2 | 1 to 1000 |
    /// | `never-ends` | | | |
    /// | `extra-power` | power \[W\] | 20 | 0 to 10,000 |
    /// | `dust` | share of the array's power that is lost | 0.3 | 0 to 1 |
    /// | `instrument-fails` | | | |
    /// | `instrument-drifts` | what is added to each value | 0.05 | -10 to 10 |
    /// | `memory` | share of the memory that is out of order | 0.25 | 0 to 1 |
    /// | `stuck-mast` | | | |
    /// | `rock-under-wheel` | how high it lifts the wheels \[m\] | 0.3 | 0.01 to 2 |
    /// | `pitch-bias` | what is added to the pitch as measured \[rad\] | 0.6 | -1.5 to 1.5 |
    /// | `roll-bias` | what is added to the roll as measured \[rad\] | 0.6 | -1.5 to 1.5 |
    /// | `bay-heat` | heat in the bay \[W\] | 100 | 0 to 10,000 |
    /// | `fans-fail` | | | |
    ///
    /// ```
    /// use farside_actors::rover::{FaultConfig, FaultKind};
    /// let fault: FaultConfig = toml::from_str("at = '2h'\nkind = 'dust'\namount = 0.6")?;
    /// assert_eq!((fault.kind, fault.duration), (FaultKind::Dust, None));
    /// // Nose up, and still so after the rover has backed up by 1 m.
    /// let rock = "at = '1h'\nkind = 'rock-under-wheel'\npart = 'front'\namount = 0.5\ndistance = '2m'";
    /// assert_eq!(toml::from_str::<FaultConfig>(rock)?.distance_m, Some(2.0));
    /// # Ok::<(), toml::de::Error>(())
    /// ```
    pub struct FaultConfig {
        /// When it begins, from the start of the run.
        pub at: SimDuration [with = "units::duration"];
        /// Which rovers have it: a host, or a pattern over hosts.
        pub rover: String = "*".to_owned();
        /// What goes wrong.
        pub kind: FaultKind, one_of(&NAMES);
        /// How long it lasts; without, for good.
        pub duration: Option<SimDuration>
            [with = "units::duration::option", skip_serializing_if = "Option::is_none"],
            if_set(over(SimDuration::ZERO));
        /// Which instrument fails or drifts; or which part's commands end early, late or never:
        /// `wheels`, `mast`, `radio`, `heater`, `body` or an instrument's name. Without, all of them.
        /// Of a rock under wheels, which: `front`, `rear`, `left`, `right`, or a corner such as
        /// `front-left`, which it is without.
        pub part: Option<String> [skip_serializing_if = "Option::is_none"];
        /// How bad it is; see the table.
        pub amount: Option<f64> [skip_serializing_if = "Option::is_none"];
        /// How far the wheels go until they are off a rock under them, forwards and backwards added
        /// up; without, 1 m.
        pub distance_m as "distance": Option<f64>
            [with = "units::length_m::option", skip_serializing_if = "Option::is_none"],
            if_set(in_unit("m", 0.01..=1000.0));
    }
}

settings! {
    /// The `[rover.fault_rates]` table: how often each kind of fault comes by chance, for each
    /// rover and sol. The times are drawn for each rover and kind by themselves, so that a higher rate of one
    /// leaves the others where they were.
    pub struct FaultRates {
        /// How long they last in the mean; the time is exponential.
        pub lasts: SimDuration [with = "units::duration"] = SimDuration::from_secs(1800),
            over(SimDuration::ZERO);
        /// Something lies in the way.
        pub blocked_path: f64 = 0.0, in_unit("a sol", 0.0..=1000.0);
        /// The wheels slip.
        pub slip: f64 = 0.0, in_unit("a sol", 0.0..=1000.0);
        /// Commands end early.
        pub ends_early: f64 = 0.0, in_unit("a sol", 0.0..=1000.0);
        /// Commands end late.
        pub ends_late: f64 = 0.0, in_unit("a sol", 0.0..=1000.0);
        /// Commands never end.
        pub never_ends: f64 = 0.0, in_unit("a sol", 0.0..=1000.0);
        /// Something takes power.
        pub extra_power: f64 = 0.0, in_unit("a sol", 0.0..=1000.0);
        /// Dust falls on the array.
        pub dust: f64 = 0.0, in_unit("a sol", 0.0..=1000.0);
        /// An instrument fails.
        pub instrument_fails: f64 = 0.0, in_unit("a sol", 0.0..=1000.0);
        /// An instrument drifts.
        pub instrument_drifts: f64 = 0.0, in_unit("a sol", 0.0..=1000.0);
        /// Memory is out of order.
        pub memory: f64 = 0.0, in_unit("a sol", 0.0..=1000.0);
        /// The mast is stuck.
        pub stuck_mast: f64 = 0.0, in_unit("a sol", 0.0..=1000.0);
        /// A rock is under a wheel.
        pub rock_under_wheel: f64 = 0.0, in_unit("a sol", 0.0..=1000.0);
        /// The pitch is measured wrongly.
        pub pitch_bias: f64 = 0.0, in_unit("a sol", 0.0..=1000.0);
        /// The roll is measured wrongly.
        pub roll_bias: f64 = 0.0, in_unit("a sol", 0.0..=1000.0);
        /// Something heats the bay.
        pub bay_heat: f64 = 0.0, in_unit("a sol", 0.0..=1000.0);
        /// The fans stand still.
        pub fans_fail: f64 = 0.0, in_unit("a sol", 0.0..=1000.0);
    }
}

impl FaultRates {
    fn per_sol(&self, kind: FaultKind) -> f64 {
        match kind {
            FaultKind::BlockedPath => self.blocked_path,
            FaultKind::Slip => self.slip,
            FaultKind::EndsEarly => self.ends_early,
            FaultKind::EndsLate => self.ends_late,
            FaultKind::NeverEnds => self.never_ends,
            FaultKind::ExtraPower => self.extra_power,
            FaultKind::Dust => self.dust,
            FaultKind::InstrumentFails => self.instrument_fails,
            FaultKind::InstrumentDrifts => self.instrument_drifts,
            FaultKind::Memory => self.memory,
            FaultKind::StuckMast => self.stuck_mast,
            FaultKind::RockUnderWheel => self.rock_under_wheel,
            FaultKind::PitchBias => self.pitch_bias,
            FaultKind::RollBias => self.roll_bias,
            FaultKind::BayHeat => self.bay_heat,
            FaultKind::FansFail => self.fans_fail,
        }
    }
}

/// A fault begins: told to the hardware.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FaultBegins {
    /// Its place among the rover's faults.
    pub number: u32,
    /// What goes wrong.
    pub kind: FaultKind,
    /// Of which part; empty if of all.
    pub part: String,
    /// How bad it is, as [`FaultConfig`] says; 0 for kinds without an amount.
    pub amount: f64,
    /// How far the wheels go until they are over it \[m\]; 0 for kinds that no driving ends.
    pub distance_m: f64,
}

/// A fault is over: told to the hardware.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FaultEnds {
    /// Its place among the rover's faults.
    pub number: u32,
}

/// A fault that is to be.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedFault {
    /// When it begins.
    pub at: SimTime,
    /// When it is over; none for good.
    pub ends: Option<SimTime>,
    /// What is told of it.
    pub begins: FaultBegins,
}

impl FaultConfig {
    /// Checks values beside each other; `key` is the entry's place in the scenario, `parts` the
    /// names of parts that every rover has, and `instruments` of those that this one has.
    pub(super) fn check_together(
        &self,
        key: &str,
        parts: &[&str],
        instruments: &[&str],
    ) -> Result<(), SetupError> {
        let wrong =
            |name: &str, message: String| Err(SetupError::value(&format!("{key}.{name}"), message));
        if let Err(error) = Pattern::over_names(&self.rover) {
            return wrong("rover", error.to_string());
        }
        let kind = self.kind.name();
        match (self.kind.amount(), self.amount) {
            (None, Some(amount)) => {
                return wrong("amount", format!("{amount}: kind = {kind:?} has no amount"));
            }
            (Some([_, least, most]), Some(amount)) if !(least..=most).contains(&amount) => {
                let expected = format!("expected {least} to {most} for kind = {kind:?}");
                return wrong("amount", format!("{amount}: {expected}"));
            }
            _ => {}
        }
        if let (None, Some(distance_m)) = (self.kind.distance_m(), self.distance_m) {
            let message = format!("{distance_m} m: no driving ends kind = {kind:?}");
            return wrong("distance", message);
        }
        let Some(part) = &self.part else {
            return Ok(());
        };
        let allowed: Vec<&str> = match self.kind.parts() {
            PartsOf::All => [parts, instruments].concat(),
            PartsOf::Instruments => instruments.to_vec(),
            PartsOf::Sides => SIDES.to_vec(),
            PartsOf::None => {
                return wrong("part", format!("{part:?}: kind = {kind:?} is of no part"));
            }
        };
        if allowed.contains(&part.as_str()) {
            return Ok(());
        }
        let nearest = farside::suggest::nearest(part, allowed.iter().copied());
        let question = farside::suggest::did_you_mean(nearest.as_deref());
        let allowed = allowed.join(", ");
        wrong(
            "part",
            format!("{part:?}: expected one of {allowed}{question}"),
        )
    }

    /// Checks that it is a fault of some rover of these names.
    pub(super) fn check_rover(&self, key: &str, rovers: &[&str]) -> Result<(), SetupError> {
        let pattern = Pattern::over_names(&self.rover);
        if pattern.is_ok_and(|pattern| rovers.iter().any(|rover| pattern.matches(rover))) {
            return Ok(());
        }
        let nearest = farside::suggest::nearest(&self.rover, rovers.iter().copied());
        let question = farside::suggest::did_you_mean(nearest.as_deref());
        let message = format!("{:?} matches no rover{question}", self.rover);
        Err(SetupError::value(&format!("{key}.rover"), message))
    }

    fn planned(&self) -> PlannedFault {
        let at = SimTime::ZERO + self.at;
        let usual = self.kind.amount().map_or(0.0, |[usual, ..]| usual);
        let part = match self.kind.parts() {
            PartsOf::Sides => USUAL_SIDE,
            _ => "",
        };
        PlannedFault {
            at,
            ends: self.duration.map(|duration| at.saturating_add(duration)),
            begins: FaultBegins {
                number: 0,
                kind: self.kind,
                part: self.part.clone().unwrap_or_else(|| part.to_owned()),
                amount: self.amount.unwrap_or(usual),
                distance_m: self
                    .distance_m
                    .or(self.kind.distance_m())
                    .unwrap_or_default(),
            },
        }
    }
}

/// All faults that a rover has until a run's end, by time: those chosen for it, and those drawn for
/// it from the run's seed.
pub(super) fn plan(
    chosen: &[FaultConfig],
    rates: &FaultRates,
    rover: &str,
    seed: u64,
    until: SimDuration,
) -> Vec<PlannedFault> {
    let is_of_rover = |fault: &&FaultConfig| {
        Pattern::over_names(&fault.rover).is_ok_and(|pattern| pattern.matches(rover))
    };
    let chosen = chosen.iter().filter(is_of_rover);
    let mut all: Vec<PlannedFault> = chosen.map(FaultConfig::planned).collect();
    for kind in FaultKind::ALL {
        all.extend(by_chance(kind, rates, rover, seed, until));
    }
    all.sort_by_key(|fault| fault.at);
    for (number, fault) in (0..).zip(&mut all) {
        fault.begins.number = number;
    }
    all
}

/// Faults of one kind, as a Poisson process.
fn by_chance(
    kind: FaultKind,
    rates: &FaultRates,
    rover: &str,
    seed: u64,
    until: SimDuration,
) -> Vec<PlannedFault> {
    let per_sol = rates.per_sol(kind);
    if per_sol <= 0.0 {
        return Vec::new();
    }
    let key = RandomKey::new(seed)
        .text(rover)
        .text("faults")
        .text(kind.name());
    let mut draws = key.stream();
    let mut at = SimTime::ZERO;
    let mut all = Vec::new();
    while all.len() < MAX_BY_CHANCE {
        at = at.saturating_add(SimDuration::from_secs_f64(
            draws.exponential(SOL_S / per_sol),
        ));
        if at >= SimTime::ZERO + until {
            break;
        }
        let lasts = SimDuration::from_secs_f64(draws.exponential(rates.lasts.as_secs_f64()));
        let usual = FaultConfig {
            at: at.since(SimTime::ZERO),
            kind,
            duration: Some(lasts),
            ..FaultConfig::default()
        };
        all.push(usual.planned());
    }
    all
}
