//! The words of a relay's table: units, what can be read of a rover, and what it can be told.

use farside_actors::rover::{RoverState, View};

/// What a number is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Quantity {
    Length,
    Angle,
    Temperature,
    Share,
    Energy,
    Power,
    Time,
    Data,
}

/// A unit: a number in it times `scale` is the number in the unit that the hardware has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Unit {
    pub(super) name: &'static str,
    pub(super) of: Quantity,
    pub(super) scale: f64,
    /// What is zero in it.
    pub(super) zero: f64,
}

const fn unit(name: &'static str, of: Quantity, scale: f64) -> Unit {
    let zero = 0.0;
    Unit {
        name,
        of,
        scale,
        zero,
    }
}

const DEGREE_RAD: f64 = std::f64::consts::PI / 180.0;

/// All units. Temperatures are in degrees Celsius where the hardware tells them.
pub(super) const UNITS: [Unit; 25] = [
    unit("m", Quantity::Length, 1.0),
    unit("dm", Quantity::Length, 0.1),
    unit("cm", Quantity::Length, 0.01),
    unit("mm", Quantity::Length, 0.001),
    unit("rad", Quantity::Angle, 1.0),
    unit("mrad", Quantity::Angle, 0.001),
    unit("deg", Quantity::Angle, DEGREE_RAD),
    unit("ddeg", Quantity::Angle, 0.1 * DEGREE_RAD),
    unit("degC", Quantity::Temperature, 1.0),
    unit("ddegC", Quantity::Temperature, 0.1),
    Unit {
        name: "K",
        of: Quantity::Temperature,
        scale: 1.0,
        zero: -273.15,
    },
    unit("percent", Quantity::Share, 0.01),
    unit("permille", Quantity::Share, 0.001),
    unit("J", Quantity::Energy, 1.0),
    unit("kJ", Quantity::Energy, 1000.0),
    unit("Wh", Quantity::Energy, 3600.0),
    unit("W", Quantity::Power, 1.0),
    unit("mW", Quantity::Power, 0.001),
    unit("s", Quantity::Time, 1.0),
    unit("min", Quantity::Time, 60.0),
    unit("ms", Quantity::Time, 0.001),
    unit("B", Quantity::Data, 1.0),
    unit("kB", Quantity::Data, 1000.0),
    unit("MB", Quantity::Data, 1e6),
    unit("GB", Quantity::Data, 1e9),
];

impl Unit {
    /// The number that the hardware has.
    pub(super) fn to_hardware(self, number: f64) -> f64 {
        number * self.scale + self.zero
    }

    /// The nearest whole number in this unit, within a span.
    pub(super) fn to_model(self, number: f64, [least, most]: [i64; 2]) -> i64 {
        // A cast saturates.
        let whole = libm::round((number - self.zero) / self.scale) as i64;
        whole.clamp(least, most)
    }
}

/// What is read of a rover's state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Reading {
    East,
    North,
    PositionSigma,
    Heading,
    Compass,
    Pitch,
    Roll,
    MastPan,
    MastTilt,
    BayTemperature,
    Charge,
    Battery,
    SolarPower,
    Load,
    MemoryUsed,
    FansOn,
    Asleep,
    BrownOut,
}

/// What a reading yields.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Read {
    Number(f64),
    Truth(bool),
}

/// The readings by their names in tables; those of truths have no quantity.
pub(super) const READINGS: [(&str, Reading, Option<Quantity>); 18] = [
    ("east", Reading::East, Some(Quantity::Length)),
    ("north", Reading::North, Some(Quantity::Length)),
    (
        "position-sigma",
        Reading::PositionSigma,
        Some(Quantity::Length),
    ),
    ("heading", Reading::Heading, Some(Quantity::Angle)),
    ("compass", Reading::Compass, Some(Quantity::Angle)),
    ("pitch", Reading::Pitch, Some(Quantity::Angle)),
    ("roll", Reading::Roll, Some(Quantity::Angle)),
    ("mast-pan", Reading::MastPan, Some(Quantity::Angle)),
    ("mast-tilt", Reading::MastTilt, Some(Quantity::Angle)),
    (
        "bay-temperature",
        Reading::BayTemperature,
        Some(Quantity::Temperature),
    ),
    ("charge", Reading::Charge, Some(Quantity::Share)),
    ("battery", Reading::Battery, Some(Quantity::Energy)),
    ("solar-power", Reading::SolarPower, Some(Quantity::Power)),
    ("load", Reading::Load, Some(Quantity::Power)),
    ("memory-used", Reading::MemoryUsed, Some(Quantity::Share)),
    ("fans-on", Reading::FansOn, None),
    ("asleep", Reading::Asleep, None),
    ("brown-out", Reading::BrownOut, None),
];

impl Reading {
    pub(super) fn of(self, state: &RoverState) -> Read {
        let number = match self {
            Reading::East => state.pose.east_m,
            Reading::North => state.pose.north_m,
            Reading::PositionSigma => state.pose.position_sigma_m,
            Reading::Heading => state.pose.yaw_rad,
            Reading::Compass => state.compass_rad,
            Reading::Pitch => state.pose.pitch_rad,
            Reading::Roll => state.pose.roll_rad,
            Reading::MastPan => state.pan_rad,
            Reading::MastTilt => state.tilt_rad,
            Reading::BayTemperature => state.bay_c,
            Reading::Charge => state.battery_j / state.battery_capacity_j,
            Reading::Battery => state.battery_j,
            Reading::SolarPower => state.solar_w,
            Reading::Load => state.load_w,
            Reading::MemoryUsed => {
                state.memory_used_bytes as f64 / state.memory_size_bytes.max(1) as f64
            }
            Reading::FansOn => return Read::Truth(state.fans_on),
            Reading::Asleep => return Read::Truth(state.asleep),
            Reading::BrownOut => return Read::Truth(state.brown_out),
        };
        Read::Number(number)
    }
}

/// What a rover can be told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verb {
    Drive,
    Turn,
    /// By an angle from where it heads: relays ask for the heading first.
    TurnBy,
    BackUp,
    Stop,
    Point,
    PointAt,
    Image,
    Spectrum,
    Transmit,
    Heat,
    Sleep,
    Fans,
}

/// What a command asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Needs {
    Number(Quantity),
    Name,
    Truth,
    /// A view, which is a point unless it is given.
    View,
    /// A part of the rover; all of them unless it is given.
    Part,
}

impl Needs {
    /// Whether it may be left out.
    pub(super) fn is_optional(self) -> bool {
        matches!(self, Needs::View | Needs::Part)
    }
}

/// A command by its name in tables, with its arguments.
type Told = (&'static str, Verb, &'static [(&'static str, Needs)]);

const PLACE: &[(&str, Needs)] = &[
    ("east", Needs::Number(Quantity::Length)),
    ("north", Needs::Number(Quantity::Length)),
];

const LASTS: &[(&str, Needs)] = &[("duration", Needs::Number(Quantity::Time))];

/// The commands by their names in tables.
pub(super) const COMMANDS: [Told; 13] = [
    ("drive", Verb::Drive, PLACE),
    (
        "turn",
        Verb::Turn,
        &[("heading", Needs::Number(Quantity::Angle))],
    ),
    (
        "turn-by",
        Verb::TurnBy,
        &[("angle", Needs::Number(Quantity::Angle))],
    ),
    (
        "back-up",
        Verb::BackUp,
        &[("distance", Needs::Number(Quantity::Length))],
    ),
    ("stop", Verb::Stop, &[("part", Needs::Part)]),
    (
        "point",
        Verb::Point,
        &[
            ("pan", Needs::Number(Quantity::Angle)),
            ("tilt", Needs::Number(Quantity::Angle)),
        ],
    ),
    ("point-at", Verb::PointAt, PLACE),
    (
        "image",
        Verb::Image,
        &[("camera", Needs::Name), ("view", Needs::View)],
    ),
    (
        "spectrum",
        Verb::Spectrum,
        &[("spectrometer", Needs::Name), ("view", Needs::View)],
    ),
    (
        "transmit",
        Verb::Transmit,
        &[("to", Needs::Name), ("size", Needs::Number(Quantity::Data))],
    ),
    ("heat", Verb::Heat, LASTS),
    ("sleep", Verb::Sleep, LASTS),
    ("fans", Verb::Fans, &[("on", Needs::Truth)]),
];

/// The views by their names in tables.
pub(super) const VIEWS: [(&str, View); 2] = [("point", View::Point), ("panorama", View::Panorama)];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unlike_and_units_go_both_ways() {
        let names: Vec<&str> = UNITS.iter().map(|unit| unit.name).collect();
        let mut unlike = names.clone();
        unlike.sort_unstable();
        unlike.dedup();
        assert_eq!(unlike.len(), names.len());
        for unit in UNITS {
            for number in [-40_i64, 0, 7, 99] {
                let hardware = unit.to_hardware(number as f64);
                assert_eq!(
                    unit.to_model(hardware, [-1000, 1000]),
                    number,
                    "{}",
                    unit.name
                );
            }
            assert_eq!(unit.to_model(f64::INFINITY, [0, 5]), 5);
        }
    }
}
