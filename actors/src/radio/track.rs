//! Where stations are: fixed, or on their way from one place to another.

use farside::SimTime;
use nalgebra::Point3;

/// A straight way from one place to another at constant speed; before and after, the station stands
/// at its ends. Coordinates are metres in the world's frame: x east, y north, z up.
///
/// ```
/// use farside::SimTime;
/// use farside_actors::radio::Track;
/// use nalgebra::Point3;
/// let (a, b) = (Point3::new(0.0, 0.0, 2.0), Point3::new(8.0, 0.0, 2.0));
/// let track = Track::between(a, b, SimTime::from_secs(10), SimTime::from_secs(14));
/// assert_eq!(track.at(SimTime::from_secs(11)).x, 2.0);
/// assert_eq!(track.at(SimTime::from_secs(99)), b);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Track {
    from_m: Point3<f64>,
    to_m: Point3<f64>,
    start: SimTime,
    end: SimTime,
}

impl Track {
    /// A station that stays where it is.
    pub fn fixed(place_m: Point3<f64>) -> Self {
        Track::between(place_m, place_m, SimTime::ZERO, SimTime::ZERO)
    }

    /// A station that leaves `from_m` at `start` and is at `to_m` from `end` on.
    pub fn between(from_m: Point3<f64>, to_m: Point3<f64>, start: SimTime, end: SimTime) -> Self {
        Track {
            from_m,
            to_m,
            start,
            end,
        }
    }

    /// Where the station is.
    pub fn at(&self, now: SimTime) -> Point3<f64> {
        if now >= self.end {
            return self.to_m;
        }
        let whole = self.end.since(self.start).as_secs_f64();
        let done = now.since(self.start).as_secs_f64();
        self.from_m + (self.to_m - self.from_m) * (done / whole)
    }
}
