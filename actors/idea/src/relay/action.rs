//! What a relay does for a procedure, ready to be done: which inputs go where, and what readings are
//! in the model's words.

use std::sync::Arc;

use farside::SimDuration;
use farside_actors::rover::{Aim, Command, Part, RoverState, View};
use farside_planning::model::{Model, Value};

use super::words::{Read, Reading, Unit};
use crate::register::RegisterValue;

/// A number of a command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Number {
    /// In the hardware's unit.
    Fixed(f64),
    /// The input at a place, in a unit.
    Input(usize, Unit),
}

impl Number {
    fn of(self, inputs: &[Value]) -> f64 {
        match self {
            Number::Fixed(number) => number,
            Number::Input(place, unit) => unit.to_hardware(inputs[place] as f64),
        }
    }
}

/// A name of a command.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Name {
    Fixed(Arc<str>),
    /// The symbol that is the input at a place.
    Input(usize),
}

impl Name {
    fn of(&self, inputs: &[Value], model: &Model) -> String {
        match self {
            Name::Fixed(name) => name.to_string(),
            Name::Input(place) => {
                let symbol = usize::try_from(inputs[*place]).ok();
                let name = symbol.and_then(|symbol| model.symbols.get(symbol));
                name.cloned().unwrap_or_default()
            }
        }
    }
}

/// A truth value of a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Truth {
    Fixed(bool),
    /// The input at a place.
    Input(usize),
}

impl Truth {
    fn of(self, inputs: &[Value]) -> bool {
        match self {
            Truth::Fixed(truth) => truth,
            Truth::Input(place) => inputs[place] != 0,
        }
    }
}

/// A command with its arguments.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Action {
    Drive([Number; 2]),
    Turn(Number),
    /// By an angle from where the rover heads, which is asked for first.
    TurnBy(Number),
    BackUp(Number),
    Stop(Option<Part>),
    Point([Number; 2]),
    PointAt([Number; 2]),
    Image(Name, View),
    Spectrum(Name, View),
    Transmit(Name, Number),
    Heat(Number),
    Sleep(Number),
    Fans(Truth),
}

impl Action {
    /// Whether the rover's heading has to be known for it.
    pub(super) fn needs_heading(&self) -> bool {
        matches!(self, Action::TurnBy(_))
    }

    /// The instrument that it is for, if it is for one.
    pub(super) fn instrument(&self) -> Option<Name> {
        match self {
            Action::Image(name, _) | Action::Spectrum(name, _) => Some(name.clone()),
            Action::Stop(Some(Part::Instrument { name })) => {
                Some(Name::Fixed(name.as_str().into()))
            }
            _ => None,
        }
    }

    /// The part that it is for; none for all of them.
    pub(super) fn part(&self, inputs: &[Value], model: &Model) -> Option<Part> {
        Some(match self {
            Action::Drive(_) | Action::Turn(_) | Action::TurnBy(_) | Action::BackUp(_) => {
                Part::Wheels
            }
            Action::Stop(part) => return part.clone(),
            Action::Point(_) | Action::PointAt(_) => Part::Mast,
            Action::Image(name, _) | Action::Spectrum(name, _) => Part::Instrument {
                name: name.of(inputs, model),
            },
            Action::Transmit(..) => Part::Radio,
            Action::Heat(_) => Part::Heater,
            Action::Sleep(_) => Part::Body,
            Action::Fans(_) => Part::Fans,
        })
    }

    /// The command for a procedure with these inputs, to a rover that heads so \[rad\].
    pub(super) fn command(&self, inputs: &[Value], model: &Model, heading_rad: f64) -> Command {
        let lasts = |number: &Number| SimDuration::from_secs_f64(number.of(inputs).max(0.0));
        let pair = |numbers: &[Number; 2]| numbers.map(|number| number.of(inputs));
        match self {
            Action::Drive(to) => {
                let [east_m, north_m] = pair(to);
                Command::Drive { east_m, north_m }
            }
            Action::Turn(to) => {
                let yaw_rad = to.of(inputs);
                Command::Turn { yaw_rad }
            }
            Action::TurnBy(by) => {
                let yaw_rad = wrapped(heading_rad + by.of(inputs));
                Command::Turn { yaw_rad }
            }
            Action::BackUp(by) => {
                let distance_m = by.of(inputs);
                Command::BackUp { distance_m }
            }
            Action::Stop(part) => Command::Stop { part: part.clone() },
            Action::Point(at) => {
                let [pan_rad, tilt_rad] = pair(at);
                let aim = Aim::Angles { pan_rad, tilt_rad };
                Command::PanTilt { aim }
            }
            Action::PointAt(at) => {
                let [east_m, north_m] = pair(at);
                let aim = Aim::Place { east_m, north_m };
                Command::PanTilt { aim }
            }
            Action::Image(name, view) => Command::Image {
                camera: name.of(inputs, model),
                view: *view,
            },
            Action::Spectrum(name, view) => Command::Spectrum {
                spectrometer: name.of(inputs, model),
                view: *view,
            },
            Action::Transmit(to, size) => Command::Transmit {
                to: to.of(inputs, model),
                // A cast saturates.
                size_bytes: size.of(inputs) as u64,
            },
            Action::Heat(time) => Command::Heat {
                duration: lasts(time),
            },
            Action::Sleep(time) => Command::Sleep {
                duration: lasts(time),
            },
            Action::Fans(on) => Command::Fans { on: on.of(inputs) },
        }
    }
}

/// An angle within -pi to pi, which is where headings are.
fn wrapped(angle_rad: f64) -> f64 {
    const TURN_RAD: f64 = std::f64::consts::TAU;
    angle_rad - TURN_RAD * libm::round(angle_rad / TURN_RAD)
}

/// What is said in an output of a poll.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Output {
    Fixed(RegisterValue),
    Truth(Reading),
    /// In a unit, within the span of the output's type.
    Number(Reading, Unit, [i64; 2]),
}

impl Output {
    pub(super) fn of(&self, state: &RoverState) -> Option<RegisterValue> {
        match self {
            Output::Fixed(value) => Some(value.clone()),
            Output::Truth(reading) => match reading.of(state) {
                Read::Truth(truth) => Some(RegisterValue::Truth(truth)),
                Read::Number(_) => None,
            },
            Output::Number(reading, unit, span) => match reading.of(state) {
                Read::Number(number) => Some(RegisterValue::Number(unit.to_model(number, *span))),
                Read::Truth(_) => None,
            },
        }
    }
}
