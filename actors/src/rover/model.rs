//! Rover models: what a rover weighs, takes, holds and can do. Models go by name; a scenario names
//! one and says which of its keys are to be otherwise.
//!
//! `models.toml` beside this file has the figures, each with its source or marked as an estimate.

use farside::SimDuration;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::bay::BayModel;
use super::faults::{FaultConfig, FaultRates};
use crate::system::settings::{Table, Within, if_set, in_unit, one_of, over, such_that};
use crate::system::{Section, SetupError};
use crate::{settings, units};

/// The figures, a table for each name.
const TEXT: &str = include_str!("models.toml");

/// The names, in the file's order. A test holds them to the file.
const NAMES: [&str; 3] = ["mer", "fido", "k9"];

/// The most instruments of a rover.
const MAX_INSTRUMENTS: usize = 32;

/// The names of parts whose commands take time and that every rover has, as faults give them.
const PARTS: [&str; 5] = ["wheels", "mast", "radio", "heater", "body"];

/// The keys of a table in which one is known by its `name`: an entry of a scenario changes the
/// model's entry of that name, or adds one.
const INSTRUMENTS: &str = "instrument";

settings! {
    /// A rover: the `[rover]` table, or whatever a system calls it. Keys that are not given are
    /// those of the model.
    pub struct RoverModel {
        /// The model whose keys hold where none are given.
        pub model: String = "mer".to_owned(), one_of(&NAMES);
        /// Its mass \[kg\].
        pub mass_kg: f64 = 174.0, in_unit("kg", 0.1..=10_000.0);
        /// How far apart its wheels are, in front and behind, left and right: what roll and pitch are
        /// measured over.
        pub wheelbase_m as "wheelbase": f64 [with = "units::length_m"] = 1.4,
            in_unit("m", 0.05..=10.0);
        /// How fast it drives on level ground without rocks.
        pub speed_m_per_s as "speed": f64 [with = "units::speed_m_per_s"] = 0.05,
            in_unit("m/s", 1e-4..=10.0);
        /// How long a full turn in place takes.
        pub turn_time: SimDuration [with = "units::duration"] = SimDuration::from_secs(180),
            over(SimDuration::ZERO);
        /// How much longer it drives through rocks: it takes 1 + this x the share of the ground that
        /// rocks cover times as long.
        pub rock_slowdown: f64 = 40.0, 0.0..=1000.0;
        /// How much longer it drives on a slope: 1 + this x the slope's tangent times as long.
        pub slope_slowdown: f64 = 2.0, 0.0..=1000.0;
        /// What driving and turning takes on level ground, beyond what the body takes anyway.
        pub drive_power_w as "drive_power": f64 [with = "units::power_w"] = 100.0,
            in_unit("W", 0.0..=10_000.0);
        /// The part of the power that lifts the rover on a slope, of what its motors take for it.
        pub climb_efficiency: f64 [with = "units::fraction"] = 0.3, in_unit("of 1", 0.01..=1.0);
        /// The steepest slope that its wheels climb.
        pub slope_limit_rad as "slope_limit": f64 [with = "units::angle_rad"] = deg(25.0),
            in_unit("rad", 0.0..=1.5);
        /// The most that its body may tilt: it stops in front of steeper ground.
        pub tilt_limit_rad as "tilt_limit": f64 [with = "units::angle_rad"] = deg(30.0),
            in_unit("rad", 0.0..=1.5);
        /// How far it drives before it looks again at the ground ahead. Each such leg is an event.
        pub leg_m as "leg": f64 [with = "units::length_m"] = 1.0, in_unit("m", 0.05..=100.0);
        /// The share of the way that its wheels slip on level ground, unnoticed.
        pub slip: f64 [with = "units::fraction"] = 0.02, in_unit("of 1", 0.0..=0.9);
        /// How much more they slip on a slope: this x the square of its tangent.
        pub slip_on_slope: f64 = 1.2, 0.0..=100.0;
        /// The standard deviation of the slip of one leg.
        pub slip_sigma: f64 [with = "units::fraction"] = 0.03, in_unit("of 1", 0.0..=0.5);
        /// The standard deviation of how far the heading has strayed, unnoticed, after one metre; it
        /// grows with the root of the way.
        pub yaw_sigma_rad as "yaw_sigma": f64 [with = "units::angle_rad"] = deg(0.3),
            in_unit("rad", 0.0..=0.5);
        /// The standard deviation of roll and pitch as the inertial unit measures them.
        pub imu_sigma_rad as "imu_sigma": f64 [with = "units::angle_rad"] = deg(0.2),
            in_unit("rad", 0.0..=0.5);
        /// The standard deviation of the heading as the compass measures it.
        pub compass_sigma_rad as "compass_sigma": f64 [with = "units::angle_rad"] = deg(2.0),
            in_unit("rad", 0.0..=0.5);
        /// Rocks of this diameter or more are known from orbit: images place the rover among them.
        pub known_from_m as "known_from": f64 [with = "units::length_m"] = 1.5,
            in_unit("m", 0.0..=100.0);
        /// What the battery holds.
        pub battery_j as "battery": f64 [with = "units::energy_j"] = 2.0e6,
            in_unit("J", 1.0..=1e12);
        /// What share of it is there at the start.
        pub charge: f64 [with = "units::fraction"] = 0.8;
        /// The share at which all loads are cut off: the brown-out.
        pub cutoff: f64 [with = "units::fraction"] = 0.15, in_unit("of 1", 0.0..=0.9);
        /// The share at which a brown-out is over.
        pub recovery: f64 [with = "units::fraction"] = 0.25, in_unit("of 1", 0.0..=1.0);
        /// The share of what charges the battery that is there to be taken out again.
        pub charge_efficiency: f64 [with = "units::fraction"] = 0.95, in_unit("of 1", 0.1..=1.0);
        /// The area of the solar array \[m²\]. It lies level.
        pub array_m2: f64 = 1.3, in_unit("m²", 0.0..=1000.0);
        /// The share of the sunlight that a clean array turns into power.
        pub array_efficiency: f64 [with = "units::fraction"] = 0.2;
        /// The share of its power that dust takes from the array each sol.
        pub dust_per_sol: f64 [with = "units::fraction"] = 0.0028, in_unit("of 1", 0.0..=0.5);
        /// What the body takes while it is awake.
        pub awake_power_w as "awake_power": f64 [with = "units::power_w"] = 22.0,
            in_unit("W", 0.0..=10_000.0);
        /// What the body takes while it sleeps.
        pub sleep_power_w as "sleep_power": f64 [with = "units::power_w"] = 3.0,
            in_unit("W", 0.0..=10_000.0);
        /// What keeps it warm in the dark. It falls with the light, to nothing where the array would
        /// yield as much.
        pub night_power_w as "night_power": f64 [with = "units::power_w"] = 6.0,
            in_unit("W", 0.0..=10_000.0);
        /// What the heater takes while it is told to heat.
        pub heater_power_w as "heater_power": f64 [with = "units::power_w"] = 22.0,
            in_unit("W", 0.0..=10_000.0);
        /// What its memory holds.
        pub memory_bytes as "memory": u64 [with = "units::data_size_bytes"] = 256_000_000,
            in_unit("byte", 1..=1_000_000_000_000);
        /// How high its instruments stand on the mast.
        pub mast_m as "mast": f64 [with = "units::length_m"] = 1.5, in_unit("m", 0.05..=20.0);
        /// How long the mast takes for a full circle.
        pub slew_time: SimDuration [with = "units::duration"] = SimDuration::from_secs(120),
            over(SimDuration::ZERO);
        /// What the mast takes while it moves.
        pub slew_power_w as "slew_power": f64 [with = "units::power_w"] = 14.0,
            in_unit("W", 0.0..=10_000.0);
        /// How far the mast points down.
        pub tilt_down_rad as "tilt_down": f64 [with = "units::angle_rad"] = deg(60.0),
            in_unit("rad", 0.0..=1.58);
        /// How far the mast points up.
        pub tilt_up_rad as "tilt_up": f64 [with = "units::angle_rad"] = deg(60.0),
            in_unit("rad", 0.0..=1.58);
        /// How fast the radio sends.
        pub radio_bit_per_s as "radio_rate": u64 [with = "units::data_rate_bit_per_s"] = 128_000,
            in_unit("bit/s", 1..=1_000_000_000_000);
        /// What the radio takes while it sends.
        pub radio_power_w as "radio_power": f64 [with = "units::power_w"] = 50.0,
            in_unit("W", 0.0..=10_000.0);
        /// How long the rover goes on without a word from its controller; with 0 s, for ever.
        pub lease: SimDuration [with = "units::duration"] = SimDuration::from_secs(600);
        /// How often it records its state when nothing happens; with 0 s, never.
        pub record_every: SimDuration [with = "units::duration"] = SimDuration::from_secs(1800),
            such_that("0s, or 1s and more", SimDuration::to_string, |every: &SimDuration| {
                every.is_zero() || *every >= SimDuration::from_secs(1)
            });
        /// The bay with its electronics.
        pub bay: BayModel, Within;
        /// Its cameras and spectrometers. A pair of stereo cameras is one instrument: its image has
        /// what both see, distances among it. One of a name that the model has changes that one.
        pub instruments as "instrument": Vec<InstrumentModel>, Within;
        /// Faults at times of one's own choice.
        pub faults as "fault": Vec<FaultConfig> [skip_serializing_if = "Vec::is_empty"], Within;
        /// Faults by chance.
        pub fault_rates: FaultRates, Within;
    }
}

/// What an instrument yields.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum InstrumentKind {
    /// Texture, and where rocks are.
    #[default]
    Camera,
    /// Reflectances.
    Spectrometer,
}

settings! {
    /// An instrument of a rover: `[[rover.instrument]]`.
    pub struct InstrumentModel {
        /// Its name: commands name it so.
        pub name: String,
            such_that("a name", |_| "missing".to_owned(), |name: &String| !name.is_empty());
        /// What it yields.
        pub kind: InstrumentKind, one_of(&["camera", "spectrometer"]);
        /// Whether it is on the mast; if not, it is on the body and looks a little down.
        pub on_mast: bool = true;
        /// Where one on the body looks, from straight ahead to the left.
        pub faces_rad as "faces": f64 [with = "units::angle_rad"] = 0.0, in_unit("rad", -3.2..=3.2);
        /// How far it sees.
        pub range_m as "range": f64 [with = "units::length_m"] = 50.0, in_unit("m", 0.1..=10_000.0);
        /// Up to this range the noise is what the view says; beyond, it grows in proportion.
        pub near_m as "near": f64 [with = "units::length_m"] = 2.0, in_unit("m", 0.01..=10_000.0);
        /// What a reading of one thing takes.
        pub point: Option<ViewModel> [skip_serializing_if = "Option::is_none"], if_set(Within);
        /// What a reading of all around takes.
        pub panorama: Option<ViewModel> [skip_serializing_if = "Option::is_none"], if_set(Within);
    }
}

settings! {
    /// What one kind of reading takes and yields.
    pub struct ViewModel {
        /// How long it takes.
        pub duration: SimDuration [with = "units::duration"] = SimDuration::from_secs(60),
            over(SimDuration::ZERO);
        /// What the instrument takes meanwhile.
        pub power_w as "power": f64 [with = "units::power_w"] = 10.0, in_unit("W", 0.0..=10_000.0);
        /// How much it fills of the memory.
        pub size_bytes as "size": u64 [with = "units::data_size_bytes"] = 1_000_000,
            in_unit("byte", 0..=1_000_000_000_000);
        /// The full angle of the beam: of a camera, of the patch whose texture is one reading.
        pub beam_rad as "beam": f64 [with = "units::angle_rad"] = 0.02, in_unit("rad", 1e-4..=1.0);
        /// The standard deviation of the noise in each value, near by.
        pub noise: f64 = 0.01, 0.0..=10.0;
    }
}

fn deg(degrees: f64) -> f64 {
    degrees.to_radians()
}

/// A rover's model with its keys, as a scenario gives them: those of the model that it names, but for
/// what it says itself.
///
/// ```
/// use farside_actors::rover::RoverConfig;
/// let rover: RoverConfig = toml::from_str("
///     model = 'fido'
///     battery = '300Wh'
///     [[instrument]]
///     name = 'ips'
///     range = '30m'
/// ")?;
/// let fido = RoverConfig::named("fido").unwrap();
/// assert_eq!((rover.speed_m_per_s, rover.battery_j), (fido.speed_m_per_s, 1.08e6));
/// assert_eq!(rover.instruments.len(), fido.instruments.len());
/// let error = toml::from_str::<RoverConfig>("model = 'fibo'").unwrap_err();
/// assert!(error.to_string().contains("did you mean \"fido\"?"));
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct RoverConfig(RoverModel);

impl RoverConfig {
    /// The model of this name.
    ///
    /// # Errors
    /// When there is none; the message has the nearest name.
    pub fn named(name: &str) -> Result<RoverConfig, String> {
        let keys = toml::Value::Table(model_table(name)?);
        let model = RoverModel::deserialize(keys).map_err(|error| error.to_string())?;
        Ok(RoverConfig(model))
    }

    /// The names of all models: `mer`, `fido`, `k9`.
    pub fn names() -> impl Iterator<Item = &'static str> {
        NAMES.into_iter()
    }
}

impl std::ops::Deref for RoverConfig {
    type Target = RoverModel;

    fn deref(&self) -> &RoverModel {
        &self.0
    }
}

impl std::ops::DerefMut for RoverConfig {
    fn deref_mut(&mut self) -> &mut RoverModel {
        &mut self.0
    }
}

impl Default for RoverConfig {
    fn default() -> Self {
        RoverConfig::named("mer").expect("a test reads every model")
    }
}

impl Serialize for RoverConfig {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        self.0.serialize(to)
    }
}

impl<'de> Deserialize<'de> for RoverConfig {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let given = toml::Table::deserialize(from)?;
        let name = match given.get("model") {
            None => "mer",
            Some(toml::Value::String(name)) => name,
            Some(other) => {
                let message = format!("model: {other}: expected the name of a rover's model");
                return Err(D::Error::custom(message));
            }
        };
        let mut keys = model_table(name).map_err(D::Error::custom)?;
        overlay(&mut keys, given);
        let model = RoverModel::deserialize(toml::Value::Table(keys));
        // Without its frame, which points into a text that is not the user's.
        let model = model.map_err(|error| D::Error::custom(error.to_string().trim_end()))?;
        Ok(RoverConfig(model))
    }
}

impl Table for RoverConfig {
    fn sections(name: &str) -> Vec<Section> {
        RoverModel::sections(name)
    }

    fn check(&self, name: &str) -> Result<(), SetupError> {
        self.0.check(name)?;
        self.0.check_together(name)
    }
}

impl RoverModel {
    /// Checks values beside each other.
    fn check_together(&self, name: &str) -> Result<(), SetupError> {
        if self.recovery <= self.cutoff {
            let message = format!(
                "{}: expected more than the cutoff, which is {}",
                self.recovery, self.cutoff
            );
            return Err(SetupError::value(&format!("{name}.recovery"), message));
        }
        if self.bay.air_low_k > self.bay.air_high_k {
            let [low_k, high_k] = [self.bay.air_low_k, self.bay.air_high_k];
            let message = format!("{low_k} K: expected at most air_high, which is {high_k} K");
            return Err(SetupError::value(&format!("{name}.bay.air_low"), message));
        }
        if self.instruments.len() > MAX_INSTRUMENTS {
            let found = self.instruments.len();
            let message = format!("{found} of them: expected at most {MAX_INSTRUMENTS}");
            return Err(SetupError::value(&format!("{name}.{INSTRUMENTS}"), message));
        }
        for (index, instrument) in self.instruments.iter().enumerate() {
            let key = |key: &str| format!("{name}.instrument.{index}.{key}");
            let before = &self.instruments[..index];
            if before.iter().any(|other| other.name == instrument.name) {
                let message = format!("{:?}: expected each name once", instrument.name);
                return Err(SetupError::value(&key("name"), message));
            }
            if instrument.point.is_none() && instrument.panorama.is_none() {
                let message = "neither point nor panorama is given: it could do nothing";
                return Err(SetupError::value(&key("point"), message));
            }
        }
        let instruments = self.instruments.iter().map(|one| one.name.as_str());
        let instruments: Vec<&str> = instruments.collect();
        let mut faults = self.faults.iter().enumerate();
        faults.try_for_each(|(index, fault)| {
            fault.check_together(&format!("{name}.fault.{index}"), &PARTS, &instruments)
        })
    }

    /// Checks that each fault is one of some rover: what a system does that knows all their hosts.
    /// `name` is that of the table.
    ///
    /// ```
    /// use farside_actors::rover::RoverConfig;
    /// let text = "fault = [{ kind = 'dust', rover = 'rove_01' }]";
    /// let config: RoverConfig = toml::from_str(text)?;
    /// let error = config.check_rovers("rover", &["rover_01", "rover_02"]).unwrap_err();
    /// let expected = "rover.fault.0.rover: \"rove_01\" matches no rover; did you mean \"rover_01\"?";
    /// assert_eq!(error.to_string(), expected);
    /// # Ok::<(), toml::de::Error>(())
    /// ```
    ///
    /// # Errors
    /// When one matches no rover; the error has the nearest name.
    pub fn check_rovers(&self, name: &str, rovers: &[&str]) -> Result<(), SetupError> {
        let mut faults = self.faults.iter().enumerate();
        faults.try_for_each(|(index, fault)| {
            fault.check_rover(&format!("{name}.fault.{index}"), rovers)
        })
    }
}

/// The keys of a model, its name among them.
fn model_table(name: &str) -> Result<toml::Table, String> {
    let mut all: toml::Table = TEXT.parse().map_err(|error| format!("{error}"))?;
    let Some(toml::Value::Table(mut keys)) = all.remove(name) else {
        let nearest = farside::suggest::nearest(name, NAMES.into_iter());
        let question = farside::suggest::did_you_mean(nearest.as_deref());
        let names = NAMES.join(", ");
        return Err(format!(
            "model: {name:?}: expected one of {names}{question}"
        ));
    };
    keys.insert("model".to_owned(), toml::Value::String(name.to_owned()));
    Ok(keys)
}

/// Puts what is given over what there is: tables key by key, instruments by their names.
fn overlay(base: &mut toml::Table, given: toml::Table) {
    for (key, value) in given {
        match (base.get_mut(&key), value) {
            (Some(toml::Value::Table(base)), toml::Value::Table(given)) => overlay(base, given),
            (Some(toml::Value::Array(base)), toml::Value::Array(given)) if key == INSTRUMENTS => {
                overlay_named(base, given);
            }
            (_, value) => {
                base.insert(key, value);
            }
        }
    }
}

/// Puts entries over those of the same `name`, and others behind them.
fn overlay_named(base: &mut Vec<toml::Value>, given: Vec<toml::Value>) {
    for entry in given {
        let name = entry.get("name").cloned();
        let known = base
            .iter_mut()
            .find(|known| name.is_some() && known.get("name") == name.as_ref());
        match (known, entry) {
            (Some(toml::Value::Table(known)), toml::Value::Table(entry)) => overlay(known, entry),
            (_, entry) => base.push(entry),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_model_of_the_file_can_be_named_and_is_in_its_ranges() {
        let table: toml::Table = TEXT.parse().unwrap();
        let mut names: Vec<&str> = table.keys().map(String::as_str).collect();
        let mut known = NAMES.to_vec();
        names.sort_unstable();
        known.sort_unstable();
        assert_eq!(names, known);
        for name in NAMES {
            let model = RoverConfig::named(name).unwrap();
            assert_eq!(model.model, name);
            model.check("rover").unwrap();
            let written = toml::to_string(&model).unwrap();
            assert_eq!(toml::from_str::<RoverConfig>(&written).unwrap(), model);
        }
    }

    fn refused(text: &str) -> String {
        match toml::from_str::<RoverConfig>(text) {
            Err(error) => error.to_string(),
            Ok(config) => config.check("rover").unwrap_err().to_string(),
        }
    }

    #[test]
    fn mistakes_are_named() {
        assert!(refused("model = 'k8'").contains("did you mean \"k9\"?"));
        assert!(refused("model = 3").contains("expected the name"));
        assert!(refused("sped = '1m/s'").contains("sped"));
        assert!(refused("speed = '1W'").contains("speed"));
        assert!(refused("recovery = 0.1").contains("rover.recovery: 0.1: expected more than"));
        assert!(refused("[[instrument]]\nname = 'x'").contains("rover.instrument.2.point"));
        assert!(refused("[[instrument]]\nnoise = 1").contains("noise"));
        let error = refused("record_every = '1ms'");
        assert_eq!(
            error,
            "rover.record_every: 1ms: expected 0s, or 1s and more"
        );
        let twice = "[[instrument]]\nname = ''\n[instrument.point]";
        assert!(refused(twice).contains("rover.instrument.2.name: missing"));
    }
}
