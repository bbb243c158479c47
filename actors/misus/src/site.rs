//! What all of a team know from the start, and what is shared to build it: places and sizes of the
//! rocks, as seen from orbit; the sky; the basis of spectra; each other's names. No rover is told
//! what a rock is.

use std::sync::Arc;

use farside::{SimDuration, SimTime};
use farside_actors::rover::{InstrumentKind, RoverConfig};
use farside_worlds::Sky;
use farside_worlds::rock_field::FieldRock;
use farside_worlds::sky::SOL_S;
use nalgebra::Point2;

use crate::config::LearnConfig;
use crate::tools::Tools;
use crate::tour::sector;

/// What scientists share.
pub(crate) struct Site {
    pub(crate) config: LearnConfig,
    /// The rocks, by their numbers.
    pub(crate) catalogue: Vec<FieldRock>,
    /// The sector of each.
    pub(crate) sectors: Vec<u32>,
    /// The rovers' names, by their numbers.
    pub(crate) rovers: Vec<String>,
    /// The side of the field \[m\].
    pub(crate) side_m: f64,
    pub(crate) tools: Tools,
    pub(crate) sky: Sky,
    /// The sky's time at the start of the run \[s since a local solar midnight\].
    pub(crate) starts_s: f64,
    pub(crate) instruments: Instruments,
    /// How often a lease is renewed; none if there is no lease.
    pub(crate) renew_every: Option<SimDuration>,
}

/// Which instruments a scientist uses.
#[derive(Clone, Debug)]
pub(crate) struct Instruments {
    /// Takes an image of one rock.
    pub(crate) camera: Option<String>,
    /// Takes an image of all around.
    pub(crate) panorama: Option<String>,
    /// Takes a spectrum of one rock.
    pub(crate) spectrometer: Option<String>,
}

impl Instruments {
    /// Of a rover's instruments the first on the mast of each kind that can do it.
    pub(crate) fn of(rover: &RoverConfig) -> Instruments {
        let all = || rover.instruments.iter().filter(|one| one.on_mast);
        let name = |one: &farside_actors::rover::InstrumentModel| one.name.clone();
        let is = |kind: InstrumentKind| {
            move |one: &&farside_actors::rover::InstrumentModel| one.kind == kind
        };
        Instruments {
            camera: all()
                .filter(is(InstrumentKind::Camera))
                .find(|one| one.point.is_some())
                .map(name),
            panorama: all()
                .filter(is(InstrumentKind::Camera))
                .find(|one| one.panorama.is_some())
                .map(name),
            spectrometer: all()
                .filter(is(InstrumentKind::Spectrometer))
                .find(|one| one.point.is_some())
                .map(name),
        }
    }
}

impl Site {
    /// The sectors of a catalogue.
    pub(crate) fn sectors(catalogue: &[FieldRock], rovers: usize) -> Vec<u32> {
        let rovers = u32::try_from(rovers).unwrap_or(u32::MAX);
        let rocks = catalogue.iter();
        rocks.map(|rock| sector(rock.position_m, rovers)).collect()
    }

    /// Where a rock lies \[m\].
    pub(crate) fn place_m(&self, rock: u32) -> Point2<f64> {
        self.catalogue[rock as usize].position_m
    }

    /// The sky's time \[s since a local solar midnight\].
    pub(crate) fn sky_s(&self, now: SimTime) -> f64 {
        self.starts_s + now.as_secs_f64()
    }

    /// Whether the Sun is too low to work.
    pub(crate) fn is_dark(&self, now: SimTime) -> bool {
        let least_deg = self.config.sun_least_rad.to_degrees();
        self.sky.elevation_deg(self.sky_s(now)) < least_deg
    }

    /// Whether rovers exchange at an hour: it lies within the share of the sol around noon.
    pub(crate) fn is_in_contact(&self, now: SimTime) -> bool {
        let sols = self.sky_s(now) / SOL_S;
        let from_noon = (sols - libm::floor(sols) - 0.5).abs();
        // All of the sol at 1, and none of it, not even noon, at 0.
        from_noon < 0.5 * self.config.contact || self.config.contact >= 1.0
    }

    /// The other rovers, by number and name.
    pub(crate) fn peers(&self, me: u32) -> impl Iterator<Item = (u32, &str)> {
        let rovers = (0..).zip(self.rovers.iter().map(String::as_str));
        rovers.filter(move |(number, _)| *number != me)
    }
}

/// What a site is built from is shared by all actors and threads.
pub(crate) type SharedSite = Arc<Site>;
