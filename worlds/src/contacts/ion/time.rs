//! ION's times: seconds after a reference that `@` lines move, or dates in UTC without leap
//! seconds; and how both become nanoseconds from the plan's beginning.

use jiff::civil::{Date, DateTime, Time};

use super::super::{ContactError, ContactProblem};
use crate::decimal::{NumberError, scaled};

const NANOS: i128 = 1_000_000_000;

/// A time of the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Stamp {
    /// Nanoseconds after the plan's beginning, wherever that lies.
    Relative(i128),
    /// Nanoseconds since the year 1 began.
    Absolute(i128),
}

/// The reference that relative times count from, as the file goes on.
pub(super) struct TimeLine {
    reference: Stamp,
    /// The first date that an `@` line has set: there the plan begins.
    epoch: Option<i128>,
}

impl Default for TimeLine {
    fn default() -> Self {
        TimeLine {
            reference: Stamp::Relative(0),
            epoch: None,
        }
    }
}

impl TimeLine {
    /// Whether an `@` line has told a date.
    pub(super) fn is_dated(&self) -> bool {
        self.epoch.is_some()
    }

    /// Reads a time; an error says what was expected.
    pub(super) fn read(&self, text: &str) -> Result<Stamp, &'static str> {
        let Some(seconds) = text.strip_prefix('+') else {
            return date(text).map(Stamp::Absolute);
        };
        let nanos = scaled(seconds, 9).map_err(|error| match error {
            NumberError::TooLarge => "seconds within 584 years",
            NumberError::TooFine => "seconds with at most 9 decimal places",
            NumberError::NotANumber | NumberError::Negative => EXPECTED,
        })?;
        let nanos = i128::from(nanos);
        let far = |sum: i128| sum > i128::from(u64::MAX);
        match self.reference {
            // `@ +s` lines add up, and must end somewhere.
            Stamp::Relative(from) if far(from + nanos) => Err("seconds within 584 years"),
            Stamp::Relative(from) => Ok(Stamp::Relative(from + nanos)),
            Stamp::Absolute(from) if from + nanos > LAST_DATE => {
                Err("a time before the year 10000")
            }
            Stamp::Absolute(from) => Ok(Stamp::Absolute(from + nanos)),
        }
    }

    /// Moves the reference.
    pub(super) fn refer_to(&mut self, stamp: Stamp) {
        self.reference = stamp;
        if let (Stamp::Absolute(nanos), None) = (stamp, self.epoch) {
            self.epoch = Some(nanos);
        }
    }

    /// Where the plan begins, given all its times.
    pub(super) fn clock(&self, stamps: impl Iterator<Item = Stamp>) -> Clock {
        let dates = stamps.filter_map(|stamp| match stamp {
            Stamp::Absolute(nanos) => Some(nanos),
            Stamp::Relative(_) => None,
        });
        Clock {
            epoch: self.epoch.or_else(|| dates.min()).unwrap_or(0),
        }
    }
}

/// Counts from the plan's beginning.
pub(super) struct Clock {
    epoch: i128,
}

impl Clock {
    /// Nanoseconds from the plan's beginning; negative before it.
    pub(super) fn nanos(&self, stamp: Stamp) -> i128 {
        match stamp {
            Stamp::Relative(nanos) => nanos,
            Stamp::Absolute(nanos) => nanos - self.epoch,
        }
    }

    /// The same of a time that must not lie before.
    pub(super) fn since_start(
        &self,
        stamp: Stamp,
        found: &'static str,
        line: usize,
    ) -> Result<u64, ContactError> {
        let nanos = self.nanos(stamp);
        u64::try_from(nanos).map_err(|_| {
            let problem = match u64::try_from(-nanos / NANOS) {
                Ok(seconds) if nanos < 0 => ContactProblem::BeforeReference { seconds },
                _ => ContactProblem::TooLate { found },
            };
            ContactError::at(line, problem)
        })
    }
}

const EXPECTED: &str = "+seconds or yyyy/mm/dd-hh:mm:ss";

/// Where dates are counted from, and the first moment that they do not reach.
const FIRST_DATE: DateTime = jiff::civil::datetime(1, 1, 1, 0, 0, 0, 0);
const LAST_DATE: i128 = 3_652_059 * 86_400 * NANOS;

/// A date as nanoseconds since the year 1 began.
fn date(text: &str) -> Result<i128, &'static str> {
    let (day, time) = text.split_once('-').ok_or(EXPECTED)?;
    let [year, month, day] = three(day, '/')?;
    let [hour, minute, second] = three(time, ':')?;
    if !(1..=9999).contains(&year) || !(1..=12).contains(&month) {
        return Err("a date with a year from 1 to 9999 and a month from 1 to 12");
    }
    // No part of a date or time but the year may be over 100.
    let small = |number| i8::try_from(number).unwrap_or(i8::MAX);
    let date = Date::new(year, small(month), small(day)).map_err(|_| "a day that its month has")?;
    let time = Time::new(small(hour), small(minute), small(second), 0)
        .map_err(|_| "a time of day before 24:00:00, without leap seconds")?;
    Ok(date.to_datetime(time).duration_since(FIRST_DATE).as_nanos())
}

/// Three whole numbers of at most four digits.
fn three(text: &str, separator: char) -> Result<[i16; 3], &'static str> {
    let mut parts = text.split(separator);
    let mut next = || {
        let part = parts.next().ok_or(EXPECTED)?;
        let fits = (1..=4).contains(&part.len()) && part.bytes().all(|b| b.is_ascii_digit());
        part.parse().ok().filter(|_| fits).ok_or(EXPECTED)
    };
    let numbers = [next()?, next()?, next()?];
    parts.next().map_or(Ok(numbers), |_| Err(EXPECTED))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Days from 1970-01-01, told by any calendar.
    #[test]
    fn dates_are_those_of_the_calendar() {
        let days = |text: &str| date(text).unwrap() / NANOS / 86_400;
        let unix = days("1970/01/01-00:00:00");
        assert_eq!(days("2000/03/01-00:00:00") - unix, 11_017);
        assert_eq!(days("2024/02/29-23:59:59") - unix, 19_782);
        assert_eq!(days("2031/04/01-00:00:00") - unix, 22_370);
        assert_eq!(days("9999/12/31-00:00:00") - unix, 2_932_896);
        assert_eq!(days("0001/01/01-00:00:00"), 0);
        assert_eq!(date("9999/12/31-23:59:59"), Ok(LAST_DATE - NANOS));
        let second = date("2031/04/01-12:34:56").unwrap() / NANOS % 86_400;
        assert_eq!(second, 12 * 3600 + 34 * 60 + 56);
    }

    #[test]
    fn impossible_dates_are_refused() {
        for text in [
            "2031/02/29-00:00:00",
            "1900/02/29-00:00:00",
            "2031/13/01-00:00:00",
            "2031/00/01-00:00:00",
            "2031/04/31-00:00:00",
            "0000/01/01-00:00:00",
            "2031/04/01-24:00:00",
            "2031/04/01-23:59:60",
            "2031/04/01",
            "2031/04/01-00:00",
            "2031/04/01-00:00:00:00",
            "20310/04/01-00:00:00",
            "+2031/04/01-00:00:00",
            "600",
            "",
        ] {
            assert!(date(text).is_err(), "{text}");
        }
    }
}
