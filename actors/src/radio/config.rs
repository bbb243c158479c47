//! The `[radios.NAME]` tables of a scenario: radio systems that links may go through.

use farside::SimDuration;
use serde::{Deserialize, Serialize};

use crate::units;

/// Who may transmit when.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Access {
    /// Everyone, at any time, without a channel to share: each link has its own, both ways.
    #[default]
    FullDuplex,
    /// One at a time, in order of asking, never a collision: a medium with a perfect arbiter. With
    /// `channel = "pair"` this is half duplex.
    Scheduled,
    /// Whoever has something transmits. Transmissions that overlap collide (Abramson 1970).
    Aloha,
    /// Listen first; if someone is heard, wait for the end and a random while longer (Kleinrock
    /// and Tobagi 1975, non-persistent once it had to wait).
    Csma,
}

/// Who shares a channel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sharing {
    /// All stations of the radio.
    #[default]
    All,
    /// Each pair of stations by itself: its two directions.
    Pair,
}

/// A radio system: what is the same for all links that go through it.
///
/// | key | meaning | default |
/// |---|---|---|
/// | `light_time` | distance over the speed of light is added to each delay | false |
/// | `range` | nothing arrives from farther away (`range`) | no limit |
/// | `line_of_sight` | ground between the antennas blocks (`occluded`) | false |
/// | `occlusion_db` | ... or only weakens, by so many dB | blocks |
/// | `antenna` | height of the antennas over the ground | 1.5 m |
/// | `path_loss` | a table, see [`PathLoss`]: the signal fades with distance | none |
/// | `access` | `full-duplex`, `scheduled`, `aloha`, `csma` | `full-duplex` |
/// | `channel` | shared by `all` stations, or by each `pair` | `all` |
/// | `turnaround` | `scheduled`: the gap when another station takes over | 0 s |
/// | `slot` | unit of random waits; with `slotted`, of transmissions | 1 ms |
/// | `slotted` | `aloha`: transmissions start at multiples of `slot` | false |
/// | `window` | random waits are below so many slots, doubled with each failure | 8 |
/// | `window_max` | ... up to so many | 256 |
/// | `sense_delay` | `csma`: who began less than this ago is not heard yet | 0 s |
/// | `capture_db` | with `path_loss`: by how much a signal must exceed each other one | 10 |
/// | `queue` | messages that wait for a link that has no `queue` of its own, where a channel is shared (`queue_full`) | 64 |
///
/// A link goes through a radio by `radio = "NAME"` among its own parameters, which go on to apply:
/// its rate decides how long it is on the air, its retries what happens after a collision, its
/// queue what waits. A station transmits one message at a time, whatever link it is for; a link
/// with retries stops and waits for each answer, and the station's other links go on meanwhile.
///
/// ```
/// use farside_actors::radio::{Access, RadioConfig};
/// let radio: RadioConfig = toml::from_str("access = 'csma'\nslot = '2ms'\nrange = '300m'")?;
/// assert_eq!((radio.access, radio.range_m), (Access::Csma, Some(300.0)));
/// assert!(toml::from_str::<RadioConfig>("acess = 'csma'").is_err());
/// # Ok::<(), toml::de::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RadioConfig {
    /// Adds distance over the speed of light to each delay.
    pub light_time: bool,
    /// Nothing arrives from farther away, in metres.
    #[serde(
        rename = "range",
        with = "units::length_m::option",
        skip_serializing_if = "Option::is_none"
    )]
    pub range_m: Option<f64>,
    /// Asks whether the ground is between the antennas.
    pub line_of_sight: bool,
    /// What ground between the antennas takes from the signal, in dB; without, it takes all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub occlusion_db: Option<f64>,
    /// The height of antennas over the ground, in metres.
    #[serde(rename = "antenna", with = "units::length_m")]
    pub antenna_m: f64,
    /// Who may transmit when.
    pub access: Access,
    /// Who shares a channel.
    pub channel: Sharing,
    /// The gap when another station takes over.
    #[serde(with = "units::duration")]
    pub turnaround: SimDuration,
    /// The unit of random waits.
    #[serde(with = "units::duration")]
    pub slot: SimDuration,
    /// Transmissions start at multiples of the slot.
    pub slotted: bool,
    /// Random waits are below so many slots at first.
    pub window: u32,
    /// Random waits are below so many slots at most.
    pub window_max: u32,
    /// Who began less than this ago is not heard yet.
    #[serde(with = "units::duration")]
    pub sense_delay: SimDuration,
    /// By how many dB a signal must exceed each other one to be understood.
    pub capture_db: f64,
    /// How many messages wait for a link that has no `queue` of its own, where a channel is shared.
    pub queue: u32,
    /// How the signal fades with distance; without, it does not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub path_loss: Option<PathLoss>,
}

impl Default for RadioConfig {
    fn default() -> Self {
        RadioConfig {
            light_time: false,
            range_m: None,
            line_of_sight: false,
            occlusion_db: None,
            antenna_m: 1.5,
            access: Access::FullDuplex,
            channel: Sharing::All,
            turnaround: SimDuration::ZERO,
            slot: SimDuration::from_millis(1),
            slotted: false,
            window: 8,
            window_max: 256,
            sense_delay: SimDuration::ZERO,
            capture_db: 10.0,
            queue: 64,
            path_loss: None,
        }
    }
}

impl RadioConfig {
    /// Whether it matters where stations are.
    pub fn needs_places(&self) -> bool {
        self.light_time || self.line_of_sight || self.range_m.is_some() || self.path_loss.is_some()
    }

    /// What makes no sense, if anything: the key, what was found and what was expected.
    ///
    /// # Errors
    /// When a number is out of its range, or a key needs another one.
    pub fn check(&self) -> Result<(), (&'static str, String)> {
        let positive = [
            ("slot", self.slot.is_zero(), "a duration over zero"),
            ("window", self.window == 0, "at least 1"),
            ("queue", self.queue == 0, "at least 1"),
        ];
        if let Some((key, _, expected)) = positive.iter().find(|(_, wrong, _)| *wrong) {
            return Err((key, format!("0: expected {expected}")));
        }
        if self.window_max < self.window {
            let (found, least) = (self.window_max, self.window);
            let message = format!("{found}: expected at least {least}, the `window`");
            return Err(("window_max", message));
        }
        if self.occlusion_db.is_some() && self.path_loss.is_none() {
            let message = "expected `path_loss` beside it: without, there is no signal to weaken";
            return Err(("occlusion_db", message.to_owned()));
        }
        let mut numbers = vec![
            ("capture_db", self.capture_db),
            ("antenna", self.antenna_m),
            ("range", self.range_m.unwrap_or(0.0)),
            ("occlusion_db", self.occlusion_db.unwrap_or(0.0)),
        ];
        if let Some(loss) = &self.path_loss {
            numbers.extend([
                ("path_loss.reference_db", loss.reference_db),
                ("path_loss.exponent", loss.exponent),
                ("path_loss.shadowing_db", loss.shadowing_db),
            ]);
            let powers = [loss.tx_power_dbm, loss.noise_dbm];
            if powers.iter().any(|power| !power.is_finite()) {
                return Err(("path_loss", "expected powers that are finite".to_owned()));
            }
        }
        match numbers.iter().find(|(_, x)| !x.is_finite() || *x < 0.0) {
            Some((key, found)) => Err((key, format!("{found}: expected zero or more, finite"))),
            None => Ok(()),
        }
    }
}

/// How the signal fades with distance: the log-distance model. See the module's table.
///
/// ```
/// use farside_actors::radio::PathLoss;
/// let loss = PathLoss { shadowing_db: 0.0, ..PathLoss::default() };
/// // 27 dBm less 40 dB at a metre and 25 dB for each factor of ten.
/// assert_eq!(loss.received_dbm(100.0, 0.0), 27.0 - 40.0 - 50.0);
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PathLoss {
    /// The transmitter's power with its antenna's gain, in dBm; 27 unless given.
    pub tx_power_dbm: f64,
    /// The loss at one metre, in dB; 40 unless given, which is 2.4 GHz in free space.
    pub reference_db: f64,
    /// The exponent n; 2 in free space, 2.5 unless given.
    pub exponent: f64,
    /// The standard deviation of shadowing, in dB; 10 unless given, 0 for none.
    pub shadowing_db: f64,
    /// For how long a pair of stations keeps one draw of shadowing; 1 s unless given.
    #[serde(with = "units::duration")]
    pub shadowing_every: SimDuration,
    /// The noise at the receiver, in dBm; -90 unless given.
    pub noise_dbm: f64,
}

impl Default for PathLoss {
    /// Those of Gazebo's RF communications model.
    fn default() -> Self {
        PathLoss {
            tx_power_dbm: 27.0,
            reference_db: 40.0,
            exponent: 2.5,
            shadowing_db: 10.0,
            shadowing_every: SimDuration::from_secs(1),
            noise_dbm: -90.0,
        }
    }
}
