//! The `[radios.NAME]` tables of a scenario: radio systems that links may go through.

use farside::SimDuration;
use serde::{Deserialize, Serialize};

use crate::system::settings::{Where, Within, if_set, one_of, over, such_that};
use crate::{settings, units};

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

/// What is not below zero.
const fn not_negative() -> Where<f64> {
    let holds = |x: &f64| x.is_finite() && *x >= 0.0;
    such_that("zero or more, finite", f64::to_string, holds)
}

/// What is a number.
const fn finite() -> Where<f64> {
    such_that("a finite number", f64::to_string, |x: &f64| x.is_finite())
}

settings! {
    /// A radio system, a `[radios.NAME]` table: what is the same for all links that go through it.
    ///
    /// A link goes through a radio by `radio = "NAME"` among its own parameters, which go on to
    /// apply: its rate decides how long it is on the air, its retries what happens after a
    /// collision, its queue what waits. A station transmits one message at a time, whatever link it
    /// is for; a link with retries stops and waits for each answer, and the station's other links
    /// go on meanwhile.
    ///
    /// ```
    /// use farside_actors::radio::{Access, RadioConfig};
    /// let text = "access = 'csma'\nslot = '2ms'\nrange = '300m'";
    /// let radio: RadioConfig = toml::from_str(text)?;
    /// assert_eq!((radio.access, radio.range_m), (Access::Csma, Some(300.0)));
    /// assert!(toml::from_str::<RadioConfig>("acess = 'csma'").is_err());
    /// # Ok::<(), toml::de::Error>(())
    /// ```
    pub struct RadioConfig {
        /// Whether distance over the speed of light is added to each delay.
        pub light_time: bool;
        /// Nothing arrives from farther away, in metres: reason `range`.
        pub range_m as "range": Option<f64>
            [with = "units::length_m::option", skip_serializing_if = "Option::is_none"],
            if_set(not_negative());
        /// Whether ground between the antennas blocks: reason `occluded`.
        pub line_of_sight: bool;
        /// What ground between the antennas takes from the signal, in dB; without, it takes all.
        pub occlusion_db: Option<f64> [skip_serializing_if = "Option::is_none"],
            if_set(not_negative());
        /// The height of antennas over the ground, in metres.
        pub antenna_m as "antenna": f64 [with = "units::length_m"] = 1.5, not_negative();
        /// Who may transmit when.
        pub access: Access, one_of(&["full-duplex", "scheduled", "aloha", "csma"]);
        /// Who shares a channel: all stations, or each pair of them.
        pub channel: Sharing, one_of(&["all", "pair"]);
        /// With `access = "scheduled"`, the gap when another station takes over.
        pub turnaround: SimDuration [with = "units::duration"];
        /// The unit of random waits; with `slotted`, of transmissions.
        pub slot: SimDuration [with = "units::duration"] = SimDuration::from_millis(1),
            over(SimDuration::ZERO);
        /// With `access = "aloha"`, whether transmissions start at multiples of the slot.
        pub slotted: bool;
        /// Random waits are below so many slots at first, and below twice as many after each
        /// failure.
        pub window: u32 = 8, 1..;
        /// Random waits are below so many slots at most.
        pub window_max: u32 = 256, 1..;
        /// With `access = "csma"`, who began less than this ago is not heard yet.
        pub sense_delay: SimDuration [with = "units::duration"];
        /// With `path_loss`, by how many dB a signal must exceed each other one to be understood.
        pub capture_db: f64 = 10.0, not_negative();
        /// How many messages wait for a link that has no `queue` of its own, where a channel is
        /// shared: reason `queue_full`.
        pub queue: u32 = 64, 1..;
        /// How the signal fades with distance; without, it does not.
        pub path_loss: Option<PathLoss> [skip_serializing_if = "Option::is_none"], if_set(Within);
    }
}

impl RadioConfig {
    /// Whether a channel has to be shared.
    fn is_shared(&self) -> bool {
        self.access != Access::FullDuplex
    }

    /// Whether stations wait at random.
    fn is_random(&self) -> bool {
        matches!(self.access, Access::Aloha | Access::Csma)
    }

    /// Whether it matters where stations are.
    pub fn needs_places(&self) -> bool {
        self.light_time || self.line_of_sight || self.range_m.is_some() || self.path_loss.is_some()
    }

    /// What makes no sense together, if anything: the key, what was found and what was expected.
    ///
    /// # Errors
    /// When a key needs another one, or is at odds with it.
    pub(crate) fn check_together(&self) -> Result<(), (&'static str, String)> {
        if self.window_max < self.window {
            let (found, least) = (self.window_max, self.window);
            let message = format!("{found}: expected at least {least}, the `window`");
            return Err(("window_max", message));
        }
        if self.occlusion_db.is_some() && self.path_loss.is_none() {
            let message = "expected `path_loss` beside it: without, there is no signal to weaken";
            return Err(("occlusion_db", message.to_owned()));
        }
        Ok(())
    }

    /// What is said here and has no effect without something else that is not said: the key, and
    /// why.
    ///
    /// ```
    /// use farside_actors::radio::RadioConfig;
    /// let radio: RadioConfig = toml::from_str("sense_delay = '5us'")?;
    /// assert_eq!(radio.remarks(), ["sense_delay without csma: nobody listens"]);
    /// # Ok::<(), toml::de::Error>(())
    /// ```
    pub fn remarks(&self) -> Vec<&'static str> {
        let default = RadioConfig::default();
        let idle = RULES.iter().filter(|rule| (rule.idle)(self, &default));
        idle.map(|rule| rule.says).collect()
    }
}

/// A key that may have no effect.
struct Rule {
    says: &'static str,
    /// Whether it is said, which is other than by default, and has none.
    idle: fn(&RadioConfig, &RadioConfig) -> bool,
}

const RULES: &[Rule] = &[
    Rule {
        says: "channel with full-duplex: nobody shares a channel",
        idle: |radio, default| !radio.is_shared() && radio.channel != default.channel,
    },
    Rule {
        says: "queue with full-duplex: a link that has none waits without a limit",
        idle: |radio, default| !radio.is_shared() && radio.queue != default.queue,
    },
    Rule {
        says: "capture_db without path_loss: every signal is as strong as any other",
        idle: |radio, default| radio.capture_db != default.capture_db && radio.path_loss.is_none(),
    },
    Rule {
        says: "capture_db with full-duplex: no two transmissions meet",
        idle: |radio, default| {
            let said = radio.capture_db != default.capture_db && radio.path_loss.is_some();
            said && !radio.is_shared()
        },
    },
    Rule {
        says: "turnaround without scheduled: nobody takes over",
        idle: |radio, _| !radio.turnaround.is_zero() && radio.access != Access::Scheduled,
    },
    Rule {
        says: "slotted without aloha: transmissions start when they may",
        idle: |radio, _| radio.slotted && radio.access != Access::Aloha,
    },
    Rule {
        says: "slot without aloha or csma: nobody waits at random",
        idle: |radio, default| radio.slot != default.slot && !radio.is_random(),
    },
    Rule {
        says: "window without aloha or csma: nobody waits at random",
        idle: |radio, default| radio.window != default.window && !radio.is_random(),
    },
    Rule {
        says: "window_max without aloha or csma: nobody waits at random",
        idle: |radio, default| radio.window_max != default.window_max && !radio.is_random(),
    },
    Rule {
        says: "sense_delay without csma: nobody listens",
        idle: |radio, _| !radio.sense_delay.is_zero() && radio.access != Access::Csma,
    },
    Rule {
        says: "antenna without light_time, range, line_of_sight or path_loss: no place matters",
        idle: |radio, default| radio.antenna_m != default.antenna_m && !radio.needs_places(),
    },
    Rule {
        says: "occlusion_db without line_of_sight: nobody asks whether ground is in between",
        idle: |radio, _| radio.occlusion_db.is_some() && !radio.line_of_sight,
    },
    Rule {
        says: "path_loss.shadowing_every without shadowing: there is nothing to draw",
        idle: |radio, _| {
            let said =
                |loss: &PathLoss| loss.shadowing_every != PathLoss::default().shadowing_every;
            let idle = |loss: &PathLoss| loss.shadowing_db == 0.0 && said(loss);
            radio.path_loss.as_ref().is_some_and(idle)
        },
    },
];

settings! {
    /// How the signal fades with distance: the log-distance model. See the module's table. Unless
    /// given, its parameters are those of Gazebo's RF communications model.
    ///
    /// ```
    /// use farside_actors::radio::PathLoss;
    /// let loss = PathLoss { shadowing_db: 0.0, ..PathLoss::default() };
    /// // 27 dBm less 40 dB at a metre and 25 dB for each factor of ten.
    /// assert_eq!(loss.received_dbm(100.0, 0.0), 27.0 - 40.0 - 50.0);
    /// ```
    pub struct PathLoss {
        /// The transmitter's power with its antenna's gain, in dBm.
        pub tx_power_dbm: f64 = 27.0, finite();
        /// The loss at one metre, in dB; 40 is 2.4 GHz in free space.
        pub reference_db: f64 = 40.0, not_negative();
        /// The exponent n; 2 in free space.
        pub exponent: f64 = 2.5, not_negative();
        /// The standard deviation of shadowing, in dB; 0 for none.
        pub shadowing_db: f64 = 10.0, not_negative();
        /// For how long a pair of stations keeps one draw of shadowing.
        pub shadowing_every: SimDuration [with = "units::duration"] = SimDuration::from_secs(1);
        /// The noise at the receiver, in dBm.
        pub noise_dbm: f64 = -90.0, finite();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// For each rule in turn: a radio that it is about, and one where the key has an effect.
    const CASES: &[(&str, &str)] = &[
        ("channel = 'pair'", "channel = 'pair'\naccess = 'aloha'"),
        ("queue = 9", "queue = 9\naccess = 'csma'"),
        (
            "capture_db = 3.0\naccess = 'aloha'",
            "capture_db = 3.0\naccess = 'aloha'\npath_loss = {}",
        ),
        (
            "capture_db = 3.0\npath_loss = {}",
            "capture_db = 3.0\npath_loss = {}\naccess = 'csma'",
        ),
        (
            "turnaround = '1ms'",
            "turnaround = '1ms'\naccess = 'scheduled'",
        ),
        (
            "slotted = true\naccess = 'csma'",
            "slotted = true\naccess = 'aloha'",
        ),
        ("slot = '2ms'", "slot = '2ms'\naccess = 'csma'"),
        ("window = 9", "window = 9\naccess = 'aloha'"),
        (
            "window_max = 99\naccess = 'scheduled'",
            "window_max = 99\naccess = 'csma'",
        ),
        (
            "sense_delay = '1ms'",
            "sense_delay = '1ms'\naccess = 'csma'",
        ),
        ("antenna = '3m'", "antenna = '3m'\nlight_time = true"),
        (
            "occlusion_db = 9.0\npath_loss = {}",
            "occlusion_db = 9.0\npath_loss = {}\nline_of_sight = true",
        ),
        (
            "path_loss = { shadowing_db = 0.0, shadowing_every = '2s' }",
            "path_loss = { shadowing_every = '2s' }",
        ),
    ];

    #[test]
    fn each_rule_speaks_where_it_holds_and_is_silent_where_it_does_not() {
        assert_eq!(RULES.len(), CASES.len());
        for (rule, (idle, works)) in RULES.iter().zip(CASES) {
            let on = |text: &str| toml::from_str::<RadioConfig>(text).unwrap().remarks();
            assert_eq!(on(idle), [rule.says], "{idle}");
            assert_eq!(on(works), [""; 0], "{works}");
        }
    }
}
