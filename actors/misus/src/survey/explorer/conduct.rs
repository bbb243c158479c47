//! How an activity is carried out: command by command, as the hardware answers. State machines that are given
//! reports and say what is next; they know no plan and no clock.

use farside_actors::rover::{
    Aim, Command, CommandEnd, CommandReport, Failure, PoseEstimate, Refusal, StopCause, View,
};
use nalgebra::{Point2, Rotation2, Vector2};

use crate::analysis::goals::Observation;
use crate::shac::Reason;
use crate::site::Instruments;

/// How often a rover tries to get round what is in its way.
const DETOURS: u32 = 4;

/// How far it backs up from what is in its way \[m\].
const BACK_UP_M: f64 = 1.0;

/// What comes next in an activity.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Next {
    /// To give this command, and to hand back its report.
    Command(Command),
    /// It is over: done, or there was too little of this.
    Over(Result<(), Reason>),
}

/// A drive to where an observation is made.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Drive {
    /// What is driven to \[m\].
    target_m: Point2<f64>,
    /// How near to it the rover stops \[m\].
    stands_m: f64,
    /// From how far an observation is made all the same, where there is no way on \[m\].
    reach_m: f64,
    detours: u32,
    leg: Leg,
}

/// A part of a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Leg {
    /// To where the observation is made.
    Straight,
    /// A little away from what is in the way.
    BackingUp,
    /// Round it.
    Aside,
}

impl Drive {
    /// A drive to a place, to `stands_m` before it; from within `reach_m` it counts as there if the way ends.
    pub(super) fn new(target_m: [f64; 2], stands_m: f64, reach_m: f64) -> Drive {
        Drive {
            target_m: target_m.into(),
            stands_m,
            reach_m,
            detours: 0,
            leg: Leg::Straight,
        }
    }

    /// How often something was in the way so far.
    pub(super) fn detours(&self) -> u32 {
        self.detours
    }

    fn left_m(&self, pose: &PoseEstimate) -> Vector2<f64> {
        self.target_m - Point2::new(pose.east_m, pose.north_m)
    }

    /// The way on from a pose; over if it is near enough.
    pub(super) fn start(&mut self, pose: &PoseEstimate) -> Next {
        self.leg = Leg::Straight;
        let way_m = self.left_m(pose);
        if way_m.norm() <= self.stands_m {
            return Next::Over(Ok(()));
        }
        to(self.target_m - way_m.normalize() * self.stands_m)
    }

    /// What comes after a command of it has ended.
    pub(super) fn next(&mut self, report: &CommandReport) -> Next {
        let is_blocked = matches!(
            report.end,
            CommandEnd::Failed {
                reason: Failure::Blocked { .. }
            }
        );
        match (self.leg, &report.end) {
            (Leg::Straight, CommandEnd::Done) => Next::Over(Ok(())),
            (Leg::Aside, CommandEnd::Done) => self.start(&report.pose),
            (Leg::BackingUp, CommandEnd::Done) => self.go_round(&report.pose),
            // Where one cannot back up one may still get round.
            (Leg::BackingUp, _) if is_blocked => self.go_round(&report.pose),
            (_, _) if is_blocked && self.detours < DETOURS => {
                self.detours += 1;
                self.leg = Leg::BackingUp;
                let distance_m = BACK_UP_M;
                Next::Command(Command::BackUp { distance_m })
            }
            (_, _) if is_blocked => match self.left_m(&report.pose).norm() <= self.reach_m {
                true => Next::Over(Ok(())),
                false => Next::Over(Err(Reason::Path)),
            },
            (_, end) => Next::Over(Err(lack(end))),
        }
    }

    /// To a place beside the straight way: to the left, to the right, and farther out each time.
    fn go_round(&mut self, pose: &PoseEstimate) -> Next {
        self.leg = Leg::Aside;
        let side = if self.detours % 2 == 1 { 1.0 } else { -1.0 };
        let turn = Rotation2::new(side * std::f64::consts::FRAC_PI_3);
        let direction = self.left_m(pose).try_normalize(1e-9);
        let direction = direction.unwrap_or_else(Vector2::x);
        let aside_m = 1.5 + f64::from(self.detours);
        to(Point2::new(pose.east_m, pose.north_m) + turn * direction * aside_m)
    }
}

fn to(place_m: Point2<f64>) -> Next {
    Next::Command(Command::Drive {
        east_m: place_m.x,
        north_m: place_m.y,
    })
}

/// An observation, by a rover that is where it is made from.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Look {
    observation: Observation,
    /// The rock that has to be seen.
    rock: Option<u32>,
    place_m: Point2<f64>,
    /// Whether the rover has looked round for the rock.
    has_searched: bool,
    /// Whether an image has shown that the mast points at the rock.
    is_aimed: bool,
    at: Stage,
}

/// A part of an observation.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    Pointing,
    /// An image of the rock: the observation itself, or to see whether the mast points at it.
    Imaging,
    /// An image of all around, to see where the rock is.
    Searching,
    /// The observation itself, if it is not an image of the rock.
    Measuring,
}

impl Look {
    /// An observation of a rock, or of what is around a place.
    pub(super) fn new(observation: Observation, rock: Option<u32>, place_m: [f64; 2]) -> Look {
        Look {
            observation,
            rock,
            place_m: place_m.into(),
            has_searched: false,
            is_aimed: false,
            at: Stage::Measuring,
        }
    }

    fn is_panorama(&self) -> bool {
        matches!(
            self.observation,
            Observation::PanoramicImage | Observation::PanoramicSpectrum
        )
    }

    /// Whether a rock is observed.
    pub(super) fn is_of_rock(&self) -> bool {
        self.rock.is_some()
    }

    /// Whether the rover had to look round for the rock.
    pub(super) fn has_searched(&self) -> bool {
        self.has_searched
    }

    /// The rock, and whether it was looked round for: in vain, if the observation has failed for want of a way.
    pub(super) fn searched(&self) -> Option<u32> {
        self.rock.filter(|_| self.has_searched)
    }

    /// The same for a rover that has looked round for the rock already: it does not again.
    pub(super) fn without_search(mut self) -> Look {
        self.has_searched = true;
        self
    }

    /// The first command.
    pub(super) fn start(&mut self, with: &Instruments) -> Next {
        match self.is_panorama() {
            true => self.measure(with),
            false => self.point(),
        }
    }

    /// What comes after a command of it has ended.
    pub(super) fn next(&mut self, report: &CommandReport, with: &Instruments) -> Next {
        let is_missed = matches!(
            report.end,
            CommandEnd::Refused {
                reason: Refusal::NothingInView | Refusal::OutOfRange { .. }
            }
        );
        match (self.at, &report.end) {
            (Stage::Searching, CommandEnd::Done) => match self.place_of_rock(report) {
                Some(place_m) => {
                    self.place_m = place_m;
                    self.point()
                }
                None => Next::Over(Err(Reason::Path)),
            },
            (Stage::Pointing, CommandEnd::Done) => self.image(with),
            (Stage::Imaging, CommandEnd::Done) => match self.sees(report) {
                true if self.observation == Observation::PointImage => Next::Over(Ok(())),
                true => {
                    self.is_aimed = true;
                    self.measure(with)
                }
                false => self.search(with),
            },
            (Stage::Measuring, CommandEnd::Done) => match self.sees(report) {
                true => Next::Over(Ok(())),
                false => self.search(with),
            },
            (_, _) if is_missed => self.search(with),
            (_, end) => Next::Over(Err(lack(end))),
        }
    }

    /// Whether a report has a reading of what is observed.
    fn sees(&self, report: &CommandReport) -> bool {
        self.is_panorama() || self.rock.is_none() || self.place_of_rock(report).is_some()
    }

    /// Where the rock lies, as readings of it have it.
    fn place_of_rock(&self, report: &CommandReport) -> Option<Point2<f64>> {
        let mut readings = report.readings.iter();
        let reading = readings.find(|reading| reading.rock == self.rock)?;
        Some(Point2::new(reading.east_m, reading.north_m))
    }

    fn point(&mut self) -> Next {
        self.at = Stage::Pointing;
        let aim = Aim::Place {
            east_m: self.place_m.x,
            north_m: self.place_m.y,
        };
        Next::Command(Command::PanTilt { aim })
    }

    /// An image of the rock; without a camera, the observation itself.
    fn image(&mut self, with: &Instruments) -> Next {
        match with.camera.clone() {
            Some(camera) if !self.is_aimed => {
                self.at = Stage::Imaging;
                let view = View::Point;
                Next::Command(Command::Image { camera, view })
            }
            _ => self.measure(with),
        }
    }

    fn measure(&mut self, with: &Instruments) -> Next {
        self.at = Stage::Measuring;
        let [camera, spectrometer] = [&with.camera, &with.spectrometer].map(Clone::clone);
        let (image, spectrum) = (
            |camera, view| Command::Image { camera, view },
            |spectrometer, view| Command::Spectrum { spectrometer, view },
        );
        let command = match self.observation {
            Observation::PointImage => camera.map(|name| image(name, View::Point)),
            Observation::PointSpectrum => spectrometer.map(|name| spectrum(name, View::Point)),
            Observation::PanoramicImage => {
                let panorama = with.panorama.clone();
                panorama.map(|name| image(name, View::Panorama))
            }
            Observation::PanoramicSpectrum => {
                spectrometer.map(|name| spectrum(name, View::Panorama))
            }
        };
        command.map_or(Next::Over(Err(Reason::Hardware)), Next::Command)
    }

    /// Looks round for a rock that was missed: whoever believes to be elsewhere points beside it.
    fn search(&mut self, with: &Instruments) -> Next {
        let panorama = with.panorama.clone().filter(|_| self.rock.is_some());
        match panorama {
            Some(camera) if !std::mem::replace(&mut self.has_searched, true) => {
                self.at = Stage::Searching;
                let view = View::Panorama;
                Next::Command(Command::Image { camera, view })
            }
            _ => Next::Over(Err(Reason::Path)),
        }
    }
}

/// What there was too little of for a command that did not end as it was meant to.
pub(super) fn lack(end: &CommandEnd) -> Reason {
    match end {
        CommandEnd::Refused {
            reason: Refusal::NotEnoughEnergy { .. } | Refusal::BrownOut | Refusal::Asleep,
        }
        | CommandEnd::Failed {
            reason: Failure::BrownOut,
        } => Reason::Power,
        CommandEnd::Refused {
            reason: Refusal::NotEnoughMemory { .. },
        }
        | CommandEnd::Failed {
            reason: Failure::MemoryFull,
        } => Reason::Memory,
        CommandEnd::Failed {
            reason: Failure::Blocked { .. },
        }
        | CommandEnd::Refused {
            reason: Refusal::OutOfRange { .. } | Refusal::NothingInView,
        } => Reason::Path,
        CommandEnd::Done
        | CommandEnd::Stopped {
            by: StopCause::Command,
        } => Reason::Time,
        CommandEnd::Stopped {
            by: StopCause::Lease,
        }
        | CommandEnd::Failed { .. }
        | CommandEnd::Refused { .. } => Reason::Hardware,
    }
}
