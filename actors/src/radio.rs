//! Radios: what links share when they go through the air. Distance and terrain, the channel that
//! stations contend for, and who spoils whose transmission.
//!
//! A link by itself ([`crate::link`]) knows neither where its ends are nor who else transmits.
//! Links that name a radio are carried by a [`Radio`], a shared link and so a process of its own:
//! it is told where stations are ([`RadioChange::Moves`]), keeps the channels, and asks each link's
//! [`Transmitter`] for what is the link's own.
//!
//! On a channel, a message is a frame that waits in its link's line, contends, is on the air for
//! as long as its link's rate says, and then arrives, or is spoiled and tried again. Each of these
//! steps is an event in which the radio holds the message ([`farside::Verdicts::hold`]); what they
//! cost in delay is in [`farside::Carriage`].

mod build;
mod channel;
mod config;
mod contend;
mod path;
mod track;

use std::collections::VecDeque;
use std::sync::Arc;

use farside::carrier::{Carrier, Parcel, Verdicts};
use farside::{SimDuration, SimTime};
use farside_worlds::HeightField;
use nalgebra::Point3;
use serde::{Deserialize, Serialize};

use crate::link::{Attempt, LinkChange, Path, Timeline, Transmitter};
pub(crate) use build::RadioBuilder;
use channel::{Channel, Station, Transmission};
pub use config::{Access, PathLoss, RadioConfig, Sharing};
pub use path::{LIGHT_M_PER_S, OCCLUDED, RANGE};
pub use track::Track;

/// Why a message is lost whose transmissions all met others.
pub const COLLISION: &str = "collision";

/// What a draw of the radio is for; links number theirs from 1.
const BACKOFF: u64 = 1001;
const SHADOWING: u64 = 1002;

/// What a radio may be told.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum RadioChange {
    /// A station sets out. Places are metres in the world's frame, on the ground.
    Moves {
        /// The station's host.
        host: String,
        /// Where it is.
        from_m: [f64; 3],
        /// Where it goes, in a straight line.
        to_m: [f64; 3],
        /// When it arrives, in nanoseconds since the start of the run.
        end_ns: u64,
    },
    /// One of the links through the radio has other parameters.
    Link {
        /// The link's name.
        name: String,
        /// What it has from now on.
        change: LinkChange,
    },
}

/// A frame's way through its station and its channel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Phase {
    /// Others of the same link come first.
    #[default]
    InLine,
    /// Next, as soon as it may.
    Contending,
    OnAir,
}

/// A message that the radio holds.
#[derive(Clone, Copy, Debug, Default)]
struct Frame {
    directed: u32,
    from: Station,
    copy: u32,
    /// With overhead.
    bytes: u64,
    /// How long it would be on the air, as things stood when it came.
    airtime: SimDuration,
    /// The airtime of all messages of its link that came before.
    offset: SimDuration,
    phase: Phase,
    /// Transmissions so far.
    attempts: u32,
    /// How often it asked whose turn it is.
    looks: u32,
    /// Random waits so far.
    waits: u32,
    /// When the radio will look at it again.
    next: SimTime,
    first_start: Option<SimTime>,
    start: SimTime,
    /// The transmission that is on the air.
    attempt: Option<Attempt>,
    energy_j: f64,
}

struct Directed {
    name: String,
    from: Station,
    to: Station,
    channel: u32,
    transmitter: Transmitter,
    /// Frames in order; the first contends or is on the air.
    line: VecDeque<u32>,
    /// The bytes of all frames in it.
    line_bytes: u64,
    /// The airtime of all messages so far.
    airtime: SimDuration,
    /// When the answer to the last frame is there, if it waits for answers.
    free: SimTime,
}

struct RadioStation {
    host: String,
    track: Track,
}

/// A radio system: a shared link. See the module's front page.
pub struct Radio {
    config: RadioConfig,
    terrain: Option<Arc<HeightField>>,
    places: Vec<RadioStation>,
    /// From a host's number to its station, from 1; 0 for none.
    station_of_host: Vec<u32>,
    directed: Vec<Directed>,
    /// From (station, station) to the link, from 1; 0 for none.
    by_pair: Vec<u32>,
    channels: Vec<Channel>,
    frames: Vec<Frame>,
    free: Vec<u32>,
}

impl Radio {
    /// A radio without stations or links. With a `terrain` stations stand on it, whatever height
    /// they are said to have, and `line_of_sight` asks it.
    pub fn new(config: RadioConfig, terrain: Option<Arc<HeightField>>) -> Self {
        Radio {
            config,
            terrain,
            places: Vec::new(),
            station_of_host: Vec::new(),
            directed: Vec::new(),
            by_pair: Vec::new(),
            channels: Vec::new(),
            frames: Vec::new(),
            free: Vec::new(),
        }
    }

    /// Adds a station: the host with number `index` ([`farside::HostId::index`]), and where it
    /// stands at first. Stations come before links.
    pub fn station(&mut self, index: usize, host: &str, place_m: Point3<f64>) {
        debug_assert!(self.directed.is_empty(), "stations come before links");
        if self.station_of_host.len() <= index {
            self.station_of_host.resize(index + 1, 0);
        }
        self.places.push(RadioStation {
            host: host.to_owned(),
            track: Track::fixed(place_m),
        });
        self.station_of_host[index] = self.places.len() as u32;
    }

    /// Adds a link between the hosts with these numbers, both of which are stations.
    ///
    /// # Panics
    /// When one is not: a bug in the caller.
    pub fn link(&mut self, name: &str, from: usize, to: usize, timeline: impl Into<Arc<Timeline>>) {
        let count = self.places.len();
        self.by_pair.resize(count * count, 0);
        let transmitter = match self.config.access {
            Access::FullDuplex => Transmitter::new(timeline).in_lane(name),
            _ => Transmitter::behind_shared(name, timeline),
        };
        let (from, to) = (self.station_of_host[from] - 1, self.station_of_host[to] - 1);
        let channel = match self.config.channel {
            Sharing::All => 0,
            Sharing::Pair => {
                let back = self.by_pair[to as usize * count + from as usize];
                match back.checked_sub(1) {
                    Some(back) => self.directed[back as usize].channel,
                    None => self.channels.len() as u32,
                }
            }
        };
        if self.channels.len() <= channel as usize {
            self.channels
                .resize(channel as usize + 1, Channel::default());
        }
        self.directed.push(Directed {
            name: name.to_owned(),
            from,
            to,
            channel,
            transmitter,
            line: VecDeque::new(),
            line_bytes: 0,
            airtime: SimDuration::ZERO,
            free: SimTime::ZERO,
        });
        self.by_pair[from as usize * count + to as usize] = self.directed.len() as u32;
    }

    /// The link that the message takes.
    fn directed_of(&self, parcel: &Parcel<'_>) -> Option<u32> {
        let (from, to) = parcel.hosts();
        let station = |index: usize| self.station_of_host.get(index)?.checked_sub(1);
        let (from, to) = (station(from.index())?, station(to.index())?);
        self.by_pair[from as usize * self.places.len() + to as usize].checked_sub(1)
    }

    /// Where a station's antenna is.
    fn antenna(&self, station: Station, now: SimTime) -> Point3<f64> {
        let place = self.places[station as usize].track.at(now);
        match &self.terrain {
            Some(terrain) => terrain.antenna_m(place.x, place.y, self.config.antenna_m),
            None => Point3::new(place.x, place.y, place.z + self.config.antenna_m),
        }
    }

    /// What lies between the ends of a link at `now`.
    fn path(&self, parcel: &Parcel<'_>, directed: u32, now: SimTime) -> Path {
        let link = &self.directed[directed as usize];
        let ends = (self.antenna(link.from, now), self.antenna(link.to, now));
        self.config
            .path(parcel, SHADOWING, now, ends, self.terrain.as_ref())
    }

    /// The signal that a station gets from another, in dBm and without shadowing; nothing from
    /// beyond the range.
    fn mean_dbm(&self, from: Station, to: Station, now: SimTime) -> f64 {
        let (from_m, to_m) = (self.antenna(from, now), self.antenna(to, now));
        let distance_m = nalgebra::distance(&from_m, &to_m);
        if self.config.range_m.is_some_and(|range| distance_m > range) {
            return f64::NEG_INFINITY;
        }
        match &self.config.path_loss {
            Some(loss) => loss.received_dbm(distance_m, 0.0),
            // Without a model every signal within the range is as strong as any other.
            None => 0.0,
        }
    }

    /// Whether `victim` is lost to `other`, which is on the air at the same time.
    fn spoils(&self, victim: &Transmission, other: &Transmission, now: SimTime) -> bool {
        if victim.to == other.from {
            // Nobody hears while transmitting.
            return true;
        }
        let noise = self.mean_dbm(other.from, victim.to, now);
        if self.config.path_loss.is_none() {
            return noise.is_finite();
        }
        self.mean_dbm(victim.from, victim.to, now) - noise < self.config.capture_db
    }

    /// Whether a station hears that another transmits.
    fn hears(&self, station: Station, other: &Transmission, now: SimTime) -> bool {
        if other.from == station {
            return true;
        }
        let sensed = now.since(other.start) >= self.config.sense_delay;
        let least_dbm = self
            .config
            .path_loss
            .as_ref()
            .map_or(f64::MIN, |p| p.noise_dbm);
        sensed && self.mean_dbm(other.from, station, now) >= least_dbm
    }
}

impl Carrier for Radio {
    type Change = RadioChange;

    fn min_delay(&self) -> SimDuration {
        let delays = self
            .directed
            .iter()
            .map(|link| link.transmitter.min_delay());
        delays.min().unwrap_or(SimDuration::ZERO)
    }

    fn carry(&mut self, parcel: &Parcel<'_>, verdicts: &mut Verdicts) {
        if let Some(token) = parcel.token() {
            return self.resume(parcel, token as u32, verdicts);
        }
        let Some(directed) = self.directed_of(parcel) else {
            // Routes are made with the links.
            debug_assert!(false, "a message on a route that no link made");
            return verdicts.lose(RANGE);
        };
        if self.config.access != Access::FullDuplex {
            return self.accept(parcel, directed, verdicts);
        }
        let now = parcel.now();
        let path = self.path(parcel, directed, now);
        let transmitter = &mut self.directed[directed as usize].transmitter;
        for copy in 0..transmitter.copies(parcel) {
            let sent = transmitter.send(parcel, copy, now, &path);
            sent.tell(now, verdicts);
        }
    }

    fn change(&mut self, change: RadioChange, now: SimTime) {
        match change {
            RadioChange::Moves {
                host,
                from_m,
                to_m,
                end_ns,
            } => {
                let place = self.places.iter_mut().find(|place| place.host == host);
                if let Some(place) = place {
                    let end = SimTime::from_nanos(end_ns);
                    place.track = Track::between(from_m.into(), to_m.into(), now, end);
                }
            }
            RadioChange::Link { name, change } => {
                let link = self.directed.iter_mut().find(|link| link.name == name);
                if let Some(link) = link {
                    link.transmitter.change(&change, now);
                }
            }
        }
    }
}

#[cfg(test)]
thread_local! {
    /// How often a frame was looked at.
    static LOOKS: std::cell::Cell<u64> = const { std::cell::Cell::new(0) };
}

#[cfg(test)]
mod tests;
