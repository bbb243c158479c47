//! Radios: what links share when they go through the air. Distance and terrain, the channel that
//! stations contend for, and who spoils whose transmission.
//!
//! A link by itself ([`crate::link`]) knows neither where its ends are nor who else transmits. Links
//! that name a radio are carried by a [`Radio`], a shared link and so a process of its own: it is
//! told where stations are ([`RadioChange::Moves`]), keeps the channels, and asks each link for
//! what is the link's own ([`Hop`]).
//!
//! On a channel, a message is a frame that waits in its station's line, contends, is on the air for
//! as long as its link's rate says, and then arrives, or is spoiled and tried again. Each of these
//! steps is an event in which the radio holds the message ([`farside::Verdicts::hold`]); what they
//! cost in delay is in [`farside::Carriage`].

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

use crate::link::LinkChange;
use channel::{Channel, Station, Transmission};
pub use config::{Access, RadioConfig, Sharing};
pub use path::{LIGHT_M_PER_S, OCCLUDED, PathLoss, RANGE, Way};
pub use track::Track;

/// Why a message is lost whose transmissions all met others.
pub const COLLISION: &str = "collision";
/// Why a message is lost that finds its station's line full.
pub const QUEUE_FULL: &str = "queue_full";

/// What a draw of the radio is for; links number theirs from 1.
const BACKOFF: u64 = 1001;
const SHADOWING: u64 = 1002;
const FADING: u64 = 1003;

/// What a radio asks of the link that a message takes.
pub trait Hop: Send + 'static {
    /// The least delay this link adds after a transmission has ended.
    fn min_delay(&self) -> SimDuration;

    /// Decides the whole fate, where there is no channel to contend for.
    fn carry(&mut self, parcel: &Parcel<'_>, way: &Way, verdicts: &mut Verdicts);

    /// How long the message is on the air, if the transmission begins at `at`.
    fn airtime(&mut self, parcel: &Parcel<'_>, at: SimTime) -> SimDuration;

    /// What being on the air for `airtime` from `at` takes from the sender, in joules.
    fn energy_j(&mut self, airtime: SimDuration, at: SimTime) -> f64;

    /// How often a transmission that failed is repeated, and how long the sender waits for an
    /// answer that does not come.
    fn retries(&mut self, parcel: &Parcel<'_>, at: SimTime) -> (u32, SimDuration);

    /// Whether the transmission from `start` to `end`, not spoiled by others, gets through: the
    /// delay from its end (propagation and jitter in nanoseconds), or why it does not.
    ///
    /// # Errors
    /// With the reason, when it does not.
    fn attempt(
        &mut self,
        parcel: &Parcel<'_>,
        attempt: u32,
        span: (SimTime, SimTime),
        way: &Way,
    ) -> Result<(SimDuration, i64), &'static str>;

    /// Takes a change of this link.
    fn change(&mut self, change: LinkChange, now: SimTime);
}

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
    /// Others of the same station come first.
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
    phase: Phase,
    /// Transmissions so far.
    attempts: u32,
    /// Random waits so far.
    waits: u32,
    /// When the radio will look at it again.
    next: SimTime,
    first_start: Option<SimTime>,
    start: SimTime,
    energy_j: f64,
}

struct Directed<H> {
    name: String,
    from: Station,
    to: Station,
    channel: u32,
    hop: H,
}

struct Place {
    host: String,
    track: Track,
    line: VecDeque<u32>,
}

/// A radio system: a shared link. See the module's front page.
pub struct Radio<H> {
    config: RadioConfig,
    terrain: Option<Arc<HeightField>>,
    places: Vec<Place>,
    /// From a host's number to its station, from 1; 0 for none.
    station_of_host: Vec<u32>,
    directed: Vec<Directed<H>>,
    /// From (station, station) to the link, from 1; 0 for none.
    by_pair: Vec<u32>,
    channels: Vec<Channel>,
    frames: Vec<Frame>,
    free: Vec<u32>,
}

impl<H: Hop> Radio<H> {
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
        self.places.push(Place {
            host: host.to_owned(),
            track: Track::fixed(place_m),
            line: VecDeque::new(),
        });
        self.station_of_host[index] = self.places.len() as u32;
    }

    /// Adds a link between the hosts with these numbers, both of which are stations.
    ///
    /// # Panics
    /// When one is not: a bug in the caller.
    pub fn link(&mut self, name: &str, from: usize, to: usize, hop: H) {
        let count = self.places.len();
        self.by_pair.resize(count * count, 0);
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
            hop,
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

    fn way(&self, parcel: &Parcel<'_>, directed: u32, now: SimTime) -> Way {
        let link = &self.directed[directed as usize];
        let ends = (self.antenna(link.from, now), self.antenna(link.to, now));
        self.config
            .way(parcel, SHADOWING, now, ends, self.terrain.as_ref())
    }

    /// Why a transmission is lost on its way, if it is, whatever else its link does to it.
    fn fades(&self, parcel: &Parcel<'_>, attempt: u32, way: &Way) -> Option<&'static str> {
        if way.blocked.is_some() {
            return way.blocked;
        }
        let (loss, received_dbm) = (self.config.path_loss.as_ref()?, way.received_dbm?);
        let error_rate = loss.error_rate(received_dbm, 8 * parcel.size_bytes());
        let draw = parcel.random(FADING, attempt, parcel.copy()).uniform();
        (draw < error_rate).then_some(RANGE)
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

impl<H: Hop> Carrier for Radio<H> {
    type Change = RadioChange;

    fn min_delay(&self) -> SimDuration {
        let delays = self.directed.iter().map(|link| link.hop.min_delay());
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
        let mut way = self.way(parcel, directed, parcel.now());
        way.blocked = self.fades(parcel, 0, &way);
        let link = &mut self.directed[directed as usize];
        link.hop.carry(parcel, &way, verdicts);
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
                    link.hop.change(change, now);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
