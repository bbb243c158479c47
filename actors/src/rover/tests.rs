//! Tests of the hardware without a simulator, but for `tests/actor.rs`: a bench that gives it
//! commands at times and collects what comes out.

mod actor;
mod bay;
mod commands;
mod energy;
mod faults;
mod refusals;
mod tilts;

use std::sync::Arc;

use farside::{SimDuration, SimTime};
use farside_worlds::rock_field::FieldRocks;
use farside_worlds::sky::SOL_S;
use farside_worlds::{RockField, RockFieldSettings, Sky};

use super::faults::{FaultBegins, FaultKind};
use super::hardware::{Hardware, Output};
use super::*;

/// A field without hills; with this many rocks.
pub(super) fn level_field(rocks: usize) -> RockField {
    let settings = RockFieldSettings {
        hills: 0,
        rocks: FieldRocks::Exactly(rocks),
        seed: 5,
        ..RockFieldSettings::default()
    };
    RockField::generate(&settings).expect("within its ranges")
}

/// A rover in the middle of a field, two hours before noon.
pub(super) fn spec(field: RockField, config: RoverConfig) -> RoverSpec {
    RoverSpec {
        number: 3,
        name: "rover_03".to_owned(),
        config,
        site: RoverSite {
            ground: Arc::new(field),
            sky: Sky::new(-14.6, 270.0, 0.5).expect("within its ranges"),
            starts_s: 0.5 * SOL_S - 7200.0,
        },
        start: RoverStart {
            east_m: 0.0,
            north_m: 0.0,
            yaw_rad: 0.0,
        },
        seed: 11,
        until: SimDuration::from_secs(10 * 88_775),
    }
}

/// Without a lease, errors and hourly records: what is asked is what happens.
pub(super) fn exact() -> RoverConfig {
    let mut config = RoverConfig::named("mer").expect("a model");
    config.lease = SimDuration::ZERO;
    config.record_every = SimDuration::ZERO;
    (config.slip, config.slip_on_slope, config.slip_sigma) = (0.0, 0.0, 0.0);
    (config.yaw_sigma_rad, config.imu_sigma_rad) = (0.0, 0.0);
    (config.rock_slowdown, config.slope_slowdown) = (0.0, 0.0);
    // Level ground is a little rough. So light a rover does not notice it.
    config.mass_kg = 0.1;
    config
}

/// A rover on a bench.
pub(super) struct Bench {
    pub(super) hardware: Hardware,
    pub(super) now_s: f64,
    out: Vec<Output>,
    ids: u32,
    faults: u32,
}

impl Bench {
    pub(super) fn new(spec: RoverSpec) -> Bench {
        let mut bench = Bench {
            hardware: Hardware::new(Arc::new(spec)),
            now_s: 0.0,
            out: Vec::new(),
            ids: 0,
            faults: 0,
        };
        bench.pass(0.0);
        bench
    }

    /// On level ground without rocks, exact.
    pub(super) fn exact() -> Bench {
        Bench::new(spec(level_field(1), exact()))
    }

    fn now(&self) -> SimTime {
        SimTime::ZERO + SimDuration::from_secs_f64(self.now_s)
    }

    /// Lets time pass \[s\].
    pub(super) fn pass(&mut self, lasts_s: f64) {
        self.now_s += lasts_s;
        self.hardware.wake(self.now(), 0.0, &mut self.out);
    }

    /// Gives a command; returns its number.
    pub(super) fn give(&mut self, command: Command) -> u32 {
        self.ids += 1;
        let id = self.ids;
        let command = RoverCommand { id, command };
        self.hardware.command(command, &mut self.out);
        id
    }

    /// The reports since one last asked.
    pub(super) fn reports(&mut self) -> Vec<CommandReport> {
        let mut reports = Vec::new();
        self.out.retain(|output| match output {
            Output::Report(report) => {
                reports.push(report.clone());
                false
            }
            _ => true,
        });
        reports
    }

    /// The incidents since the start.
    pub(super) fn incidents(&self) -> Vec<RoverIncident> {
        let incident = |output: &Output| match output {
            Output::Incident(incident) => Some(incident.clone()),
            _ => None,
        };
        self.out.iter().filter_map(incident).collect()
    }

    /// Gives a command and waits for its end, a sol at most; how long it took \[s\], to a second,
    /// and how it ended.
    pub(super) fn done(&mut self, command: Command) -> (f64, CommandReport) {
        let (begun_s, id) = (self.now_s, self.give(command));
        loop {
            let report = self.reports().into_iter().find(|report| report.id == id);
            if let Some(report) = report {
                return (self.now_s - begun_s, report);
            }
            assert!(self.now_s - begun_s < SOL_S, "it does not end");
            self.pass(1.0);
        }
    }

    /// How a command is answered at once.
    pub(super) fn answer(&mut self, command: Command) -> Option<CommandEnd> {
        let id = self.give(command);
        let mut reports = self.reports().into_iter();
        reports
            .find(|report| report.id == id)
            .map(|report| report.end)
    }

    /// Why a command is refused.
    pub(super) fn refusal(&mut self, command: Command) -> Refusal {
        match self.answer(command) {
            Some(CommandEnd::Refused { reason }) => reason,
            other => panic!("not refused: {other:?}"),
        }
    }

    /// How many incidents of a kind there were.
    pub(super) fn count(&self, which: impl Fn(&RoverIncident) -> bool) -> usize {
        self.incidents().iter().filter(|one| which(one)).count()
    }

    /// Where energy came from and went to.
    pub(super) fn energy(&mut self) -> RoverEnergy {
        self.hardware.resources().energy
    }

    /// How far the rover is from where it believes to be \[m\].
    pub(super) fn error_m(&self) -> f64 {
        error_m(&self.hardware.pose())
    }

    pub(super) fn state(&mut self) -> RoverState {
        self.hardware.state(0)
    }

    pub(super) fn fails(&mut self, kind: FaultKind, part: &str, amount: f64) -> u32 {
        let number = 100 + self.faults;
        self.faults += 1;
        let part = part.to_owned();
        let fault = FaultBegins {
            number,
            kind,
            part,
            amount,
            distance_m: 1.0,
        };
        self.hardware.fault_begins(fault, &mut self.out);
        number
    }

    pub(super) fn mended(&mut self, number: u32) {
        self.hardware.fault_ends(number, &mut self.out);
    }
}

/// How far a rover is from where it believes to be \[m\].
pub(super) fn error_m(pose: &RoverPose) -> f64 {
    libm::hypot(
        pose.east_m - pose.estimated_east_m,
        pose.north_m - pose.estimated_north_m,
    )
}

pub(super) fn drive(east_m: f64, north_m: f64) -> Command {
    Command::Drive { east_m, north_m }
}

pub(super) fn image(view: View) -> Command {
    let camera = "pancam".to_owned();
    Command::Image { camera, view }
}

pub(super) fn spectrum(view: View) -> Command {
    let spectrometer = "mini_tes".to_owned();
    Command::Spectrum { spectrometer, view }
}

pub(super) fn at(east_m: f64, north_m: f64) -> Command {
    let aim = Aim::Place { east_m, north_m };
    Command::PanTilt { aim }
}

pub(super) fn angles(pan_rad: f64, tilt_rad: f64) -> Command {
    let aim = Aim::Angles { pan_rad, tilt_rad };
    Command::PanTilt { aim }
}

/// The ground ahead.
pub(super) fn down() -> Command {
    angles(0.0, -0.5)
}

pub(super) const STOP: Command = Command::Stop { part: None };

pub(super) fn stopped() -> CommandEnd {
    let by = StopCause::Command;
    CommandEnd::Stopped { by }
}
