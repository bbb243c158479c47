//! When messages may be sent: at any time, or in communication windows that are known beforehand.

use farside::{SimDuration, SimTime};
use thiserror::Error;

/// When the protocol may send.
///
/// ```
/// use farside::{SimDuration, SimTime};
/// use farside_misus::shac::Calendar;
/// let (hour, minute) = (SimDuration::from_secs(3600), SimDuration::from_secs(60));
/// let hourly = Calendar::repeated(SimTime::from_secs(600), minute * 10, hour)?;
/// assert!(!hourly.is_open(SimTime::from_secs(599)));
/// assert!(hourly.is_open(SimTime::from_secs(600)));
/// assert_eq!(hourly.next_open(SimTime::from_secs(1200)), Some(SimTime::from_secs(4200)));
/// # Ok::<(), farside_misus::shac::CalendarError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Calendar(Kind);

#[derive(Clone, Debug, PartialEq)]
enum Kind {
    Always,
    Repeated {
        first: SimTime,
        length: SimDuration,
        every: SimDuration,
    },
    Listed(Vec<(SimTime, SimTime)>),
}

/// Windows in which nothing can be sent, or that are in no order.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum CalendarError {
    /// There is no instant at which it is open.
    #[error("the windows never open: {actual}")]
    NeverOpen {
        /// What was given.
        actual: String,
    },
    /// A window that opens before the one before it has closed.
    #[error(
        "window {number} opens at {opens}, expected at {before} or later, when the one before it closes"
    )]
    Order {
        /// Which window, from 1.
        number: usize,
        /// When it opens.
        opens: SimTime,
        /// When the one before it closes.
        before: SimTime,
    },
    /// A window that is as long as the time between windows, or longer.
    #[error("a window of {length} every {every}: expected a shorter window")]
    TooLong {
        /// Its length.
        length: SimDuration,
        /// From one opening to the next.
        every: SimDuration,
    },
}

impl Calendar {
    /// Open at all times.
    pub fn always() -> Calendar {
        Calendar(Kind::Always)
    }

    /// Windows of one length at equal distances, without end.
    ///
    /// # Errors
    /// When the length is zero, or not below the distance.
    pub fn repeated(
        first: SimTime,
        length: SimDuration,
        every: SimDuration,
    ) -> Result<Calendar, CalendarError> {
        if length.is_zero() {
            let actual = format!("each has a length of {length}");
            return Err(CalendarError::NeverOpen { actual });
        }
        if length >= every {
            return Err(CalendarError::TooLong { length, every });
        }
        Ok(Calendar(Kind::Repeated {
            first,
            length,
            every,
        }))
    }

    /// Windows given one by one, each open from its first instant to before its second.
    ///
    /// # Errors
    /// When none of them is ever open, or they overlap or do not ascend.
    pub fn listed(windows: Vec<(SimTime, SimTime)>) -> Result<Calendar, CalendarError> {
        let mut before = SimTime::ZERO;
        for (index, &(opens, closes)) in windows.iter().enumerate() {
            if opens < before {
                let number = index + 1;
                return Err(CalendarError::Order {
                    number,
                    opens,
                    before,
                });
            }
            before = closes.max(opens);
        }
        if windows.iter().all(|(opens, closes)| opens >= closes) {
            let actual = format!("{} windows, none of which lasts", windows.len());
            return Err(CalendarError::NeverOpen { actual });
        }
        Ok(Calendar(Kind::Listed(windows)))
    }

    /// Whether something may be sent now.
    pub fn is_open(&self, now: SimTime) -> bool {
        self.next_open(now) == Some(now)
    }

    /// The first instant from now on at which something may be sent; none after the last window.
    pub fn next_open(&self, now: SimTime) -> Option<SimTime> {
        match &self.0 {
            Kind::Always => Some(now),
            Kind::Repeated {
                first,
                length,
                every,
            } => {
                if now <= *first {
                    return Some(*first);
                }
                let since = now.since(*first).as_nanos();
                let into = since % every.as_nanos();
                if into < length.as_nanos() {
                    return Some(now);
                }
                let wait = every.as_nanos() - into;
                Some(now.saturating_add(SimDuration::from_nanos(wait)))
            }
            Kind::Listed(windows) => windows
                .iter()
                .find(|(opens, closes)| now < *closes && opens < closes)
                .map(|(opens, _)| now.max(*opens)),
        }
    }
}
