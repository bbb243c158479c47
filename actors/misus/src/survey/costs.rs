//! What an observation takes at the most: what the centre asks for, and what planners reckon with.

use farside::SimDuration;
use farside_actors::rover::{InstrumentKind, RoverConfig, ViewModel};

use crate::analysis::goals::Observation;

/// What an observation takes at the most, from a rover that stands where it is made from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cost {
    /// How long, with the mast's way to the target.
    pub duration: SimDuration,
    /// What instrument and body take meanwhile \[W\].
    pub power_w: f64,
    /// What it adds to memory \[bit\].
    pub memory_bits: i64,
}

impl Cost {
    /// Of an observation by a rover; none if it has no instrument for it.
    ///
    /// ```
    /// use farside::SimDuration;
    /// use farside_actors::rover::RoverConfig;
    /// use farside_misus::analysis::goals::Observation;
    /// use farside_misus::survey::Cost;
    /// let cost = Cost::of(Observation::PointSpectrum, &RoverConfig::default()).unwrap();
    /// assert_eq!(cost.duration, SimDuration::from_secs(1200 + 120));
    /// assert_eq!((cost.power_w, cost.memory_bits), (42.0, 2_000_000));
    /// ```
    pub fn of(observation: Observation, rover: &RoverConfig) -> Option<Cost> {
        let view = view(observation, rover)?;
        let aims = match observation {
            Observation::PointImage | Observation::PointSpectrum => rover.slew_time,
            Observation::PanoramicImage | Observation::PanoramicSpectrum => SimDuration::ZERO,
        };
        Some(Cost {
            duration: aims + view.duration,
            power_w: rover.awake_power_w + view.power_w.max(rover.slew_power_w),
            memory_bits: 8 * i64::try_from(view.size_bytes).unwrap_or(i64::MAX / 8),
        })
    }
}

/// Of the instruments on the mast, the reading of the first that can do it.
fn view(observation: Observation, rover: &RoverConfig) -> Option<&ViewModel> {
    let kind = match observation {
        Observation::PanoramicImage | Observation::PointImage => InstrumentKind::Camera,
        Observation::PanoramicSpectrum | Observation::PointSpectrum => InstrumentKind::Spectrometer,
    };
    let instruments = rover.instruments.iter();
    let mut of_kind = instruments.filter(|one| one.on_mast && one.kind == kind);
    of_kind.find_map(|one| match observation {
        Observation::PointImage | Observation::PointSpectrum => one.point.as_ref(),
        Observation::PanoramicImage | Observation::PanoramicSpectrum => one.panorama.as_ref(),
    })
}
