//! Processors of virtual time: how long it takes to compute something, where that is a number of
//! operations. A processor knows from the start when it will be slower, as links know when they
//! will be worse, so that work in hand when a slowdown begins is done in parts.
//!
//! What this is not: a measurement. Work is counted, so that a run does not depend on the machine
//! that it runs on.

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use farside::{SimDuration, SimTime};
use serde::de::{Error, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::units::{UnitError, parse_rate, print_rate};

/// How fast a processor is when nothing slows it down: `"unlimited"`, or a rate such as `"400k/s"`.
///
/// ```
/// use farside_actors::processor::Speed;
/// assert_eq!("2M/s".parse(), Ok(Speed::PerS(2_000_000)));
/// assert_eq!("unlimited".parse(), Ok(Speed::Unlimited));
/// assert!("2 cores".parse::<Speed>().is_err());
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Speed {
    /// Whatever is to be computed takes no time.
    #[default]
    Unlimited,
    /// Operations in a second. What an operation is, the system says. 0 counts as 1.
    PerS(u64),
}

impl FromStr for Speed {
    type Err = UnitError;

    fn from_str(text: &str) -> Result<Self, UnitError> {
        match text.trim() {
            "unlimited" => Ok(Speed::Unlimited),
            rate => parse_rate(rate).map(Speed::PerS),
        }
    }
}

impl fmt::Display for Speed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Speed::Unlimited => f.write_str("unlimited"),
            Speed::PerS(speed) => f.write_str(&print_rate(*speed)),
        }
    }
}

impl Serialize for Speed {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Speed {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let text = String::deserialize(from)?;
        text.parse().map_err(D::Error::custom)
    }
}

/// By how much a processor is slower than usual: a factor in [0.000001, 1e9], kept in millionths.
/// Below 1 the processor is faster.
///
/// ```
/// use farside_actors::processor::Slowdown;
/// assert_eq!(Slowdown::new(2.5).unwrap().factor(), 2.5);
/// assert_eq!(Slowdown::new(0.0), None);
/// assert_eq!(Slowdown::new(f64::NAN), None);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Slowdown {
    millionths: u64,
}

impl Slowdown {
    /// As fast as usual.
    pub const NONE: Slowdown = Slowdown {
        millionths: MILLION,
    };

    /// This factor, rounded to millionths; none if it is out of range.
    pub fn new(factor: f64) -> Option<Slowdown> {
        let millionths = factor * MILLION as f64;
        (1.0..=1e15).contains(&millionths).then(|| Slowdown {
            millionths: millionths.round() as u64,
        })
    }

    /// The factor.
    pub fn factor(self) -> f64 {
        self.millionths as f64 / MILLION as f64
    }
}

const MILLION: u64 = 1_000_000;

impl Serialize for Slowdown {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        // Whole factors are written without a point, as people write them.
        match self.millionths.is_multiple_of(MILLION) {
            true => to.serialize_u64(self.millionths / MILLION),
            false => to.serialize_f64(self.factor()),
        }
    }
}

impl<'de> Deserialize<'de> for Slowdown {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Factor;

        impl Visitor<'_> for Factor {
            type Value = Slowdown;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a factor such as 50 or 2.5")
            }

            fn visit_i64<E: Error>(self, factor: i64) -> Result<Slowdown, E> {
                self.visit_f64(factor as f64)
            }

            fn visit_u64<E: Error>(self, factor: u64) -> Result<Slowdown, E> {
                self.visit_f64(factor as f64)
            }

            fn visit_f64<E: Error>(self, factor: f64) -> Result<Slowdown, E> {
                Slowdown::new(factor).ok_or_else(|| {
                    let range = "a factor above 0, from 0.000001 to 1000000000";
                    E::custom(format!("{factor}: expected {range}"))
                })
            }
        }

        from.deserialize_any(Factor)
    }
}

/// A processor: a speed, and when it is slower.
///
/// While it is slowed down by a factor it does its operations a second divided by that, rounded
/// down to billionths of an operation a second. With that all is exact: work that a slowdown
/// begins or ends in is done in parts, and what it takes is rounded up to nanoseconds once.
///
/// ```
/// use farside::{SimDuration, SimTime};
/// use farside_actors::processor::{Processor, Slowdown, Speed};
/// let secs = SimTime::from_secs;
/// let processor = Processor::new(Speed::PerS(100))
///     .then(secs(10), Slowdown::new(50.0).unwrap())
///     .then(secs(20), Slowdown::NONE);
/// // Half of it before the slowdown, 20 operations meanwhile, the rest after it.
/// assert_eq!(processor.time_for(secs(9), 200), SimDuration::from_millis(11_800));
/// assert_eq!(processor.time_for(secs(30), 200), SimDuration::from_secs(2));
/// let unlimited = Processor::new(Speed::Unlimited);
/// assert!(unlimited.time_for(secs(9), 200).is_zero());
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Processor {
    speed: Speed,
    /// From when on it is slower, and by how much, in order. As fast as usual before the first.
    slowdowns: Arc<Vec<(SimTime, Slowdown)>>,
}

/// A century or so, which will do for what never ends.
const LONGEST_NS: u64 = 1 << 61;

/// Billionths of an operation, times nanoseconds in a second: what one operation is.
const OPERATION: u128 = 1_000_000_000 * 1_000_000_000;

impl Processor {
    /// A processor that is never slowed down.
    pub fn new(speed: Speed) -> Self {
        Processor {
            speed,
            slowdowns: Arc::default(),
        }
    }

    /// The same, slowed down from `from` on. Whatever came after is forgotten.
    #[must_use]
    pub fn then(mut self, from: SimTime, slowdown: Slowdown) -> Self {
        let slowdowns = Arc::make_mut(&mut self.slowdowns);
        slowdowns.retain(|(at, _)| *at < from);
        slowdowns.push((from, slowdown));
        self
    }

    /// How fast it is when nothing slows it down.
    pub fn speed(&self) -> Speed {
        self.speed
    }

    /// When it becomes slower or faster, in order, and by which factor it is slower from then on.
    pub fn slowdowns(&self) -> impl Iterator<Item = (SimTime, Slowdown)> + '_ {
        self.slowdowns.iter().copied()
    }

    /// By how much it is slower at `at`.
    pub fn slowdown_at(&self, at: SimTime) -> Slowdown {
        let next = self.next(at);
        let current = next.checked_sub(1).map(|index| self.slowdowns[index].1);
        current.unwrap_or(Slowdown::NONE)
    }

    /// The first change after `at`.
    fn next(&self, at: SimTime) -> usize {
        self.slowdowns.partition_point(|(from, _)| *from <= at)
    }

    /// Billionths of an operation in a second; none if it is unlimited.
    fn pace(&self, slowdown: Slowdown) -> Option<u128> {
        let Speed::PerS(speed) = self.speed else {
            return None;
        };
        let healthy = u128::from(speed.max(1)) * 1_000_000_000;
        Some((healthy * u128::from(MILLION) / u128::from(slowdown.millionths)).max(1))
    }

    /// How long `operations` take that begin at `from`, rounded up to nanoseconds; at most 2^61 ns.
    pub fn time_for(&self, from: SimTime, operations: u64) -> SimDuration {
        let mut left = u128::from(operations) * OPERATION;
        let mut at = from;
        loop {
            let Some(pace) = self.pace(self.slowdown_at(at)) else {
                return SimDuration::ZERO;
            };
            if let Some((change, _)) = self.slowdowns.get(self.next(at)) {
                let done = pace.saturating_mul(u128::from(change.since(at).as_nanos()));
                if done < left {
                    left -= done;
                    at = *change;
                    continue;
                }
            }
            let rest = u64::try_from(left.div_ceil(pace)).unwrap_or(u64::MAX);
            let all = at.since(from).as_nanos().saturating_add(rest);
            return SimDuration::from_nanos(all.min(LONGEST_NS));
        }
    }

    /// How many operations are done in `time`, if it goes on at the pace it has at `now`: what who
    /// plans with it can know. None if any number is.
    ///
    /// ```
    /// use farside::{SimDuration, SimTime};
    /// use farside_actors::processor::{Processor, Speed};
    /// let processor = Processor::new(Speed::PerS(3));
    /// let done = processor.operations_in(SimTime::ZERO, SimDuration::from_millis(999));
    /// assert_eq!(done, Some(2));
    /// ```
    pub fn operations_in(&self, now: SimTime, time: SimDuration) -> Option<u64> {
        let pace = self.pace(self.slowdown_at(now))?;
        let done = pace.saturating_mul(u128::from(time.as_nanos())) / OPERATION;
        Some(u64::try_from(done).unwrap_or(u64::MAX))
    }
}

/// What the actor that has a processor is told when it becomes slower or faster, and with that the
/// log. The processor knew it from the start: there is nothing left for the actor to do.
///
/// ```
/// use farside_actors::processor::ProcessorChange;
/// let change = ProcessorChange { processor: "node_07/planner".to_owned(), slowdown: 50.0 };
/// assert_eq!(change.slowdown, 50.0);
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProcessorChange {
    /// Its name, `{host}/{processor}`.
    pub processor: String,
    /// By which factor it is slower from now on than when nothing slows it down.
    pub slowdown: f64,
}

#[cfg(test)]
mod tests;
