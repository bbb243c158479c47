//! Capacity traces: a recorded link, as the instants at which it could have delivered a packet.

use std::fmt;

use farside::{SimDuration, SimTime};

use super::error::shown;
use super::{ContactError, ContactProblem, text_of};
use crate::decimal::{NumberError, scaled};

/// The most stamps of a trace.
const MAX_STAMPS: usize = 4_000_000;

/// The longest period \[ms\]: a year. What is longer is no trace in milliseconds.
const MAX_STAMP_MS: u64 = 366 * 86_400_000;

const NANOS_PER_MS: u64 = 1_000_000;

/// When a link can deliver its packets: opportunities to deliver [`CapacityTrace::PACKET_BYTES`]
/// each, which repeat with a period for ever. Numbered from 0; several may share an instant.
///
/// ```
/// use farside::{SimDuration, SimTime};
/// use farside_worlds::contacts::CapacityTrace;
/// let trace = CapacityTrace::from_mahimahi(b"3\n3\n10\n")?;
/// let at = |ms| SimTime::ZERO + SimDuration::from_millis(ms);
/// assert_eq!(trace.period(), SimDuration::from_millis(10));
/// let times: Vec<SimTime> = (0..5).map(|n| trace.opportunity(n)).collect();
/// assert_eq!(times, [at(3), at(3), at(10), at(13), at(13)]);
/// assert_eq!(trace.next_opportunity(at(11)), at(13));
/// // A message of 4000 bytes that is ready after 11 ms takes three opportunities.
/// let first = trace.first_from(at(11));
/// assert_eq!(trace.opportunity(first + 2), at(20));
/// # Ok::<(), farside_worlds::contacts::ContactError>(())
/// ```
#[derive(Clone, PartialEq, Eq)]
pub struct CapacityTrace {
    /// Of the first period, never decreasing; the last one is the period.
    opportunities_ns: Vec<u64>,
}

impl CapacityTrace {
    /// What one opportunity delivers.
    pub const PACKET_BYTES: u64 = 1500;

    /// Reads a mahimahi trace: on each line the millisecond of one opportunity; the last one is
    /// the period, too.
    ///
    /// ```
    /// use farside_worlds::contacts::CapacityTrace;
    /// let error = CapacityTrace::from_mahimahi(b"4\n7\n5\n").unwrap_err();
    /// assert_eq!(error.to_string(), "line 3: 5 ms after 7 ms: stamps must not decrease");
    /// ```
    ///
    /// # Errors
    /// With the line, when the text is no such file, has more than 16 MiB or 4,000,000 stamps,
    /// none at all, or a last one of 0.
    pub fn from_mahimahi(bytes: &[u8]) -> Result<CapacityTrace, ContactError> {
        let text = text_of(bytes)?.trim_end();
        if text.is_empty() {
            return Err(ContactError::Empty { what: "stamp" });
        }
        let mut opportunities_ns = Vec::new();
        let mut before = 0;
        for (index, line) in text.split('\n').enumerate() {
            let stamp = stamp(line, index + 1)?;
            if stamp < before {
                let problem = ContactProblem::Decreases {
                    found: stamp,
                    before,
                };
                return Err(ContactError::at(index + 1, problem));
            }
            if index == MAX_STAMPS {
                let (what, limit) = ("stamps", MAX_STAMPS);
                return Err(ContactError::at(
                    index + 1,
                    ContactProblem::TooMany { what, limit },
                ));
            }
            opportunities_ns.push(stamp * NANOS_PER_MS);
            before = stamp;
        }
        if before == 0 {
            return Err(ContactError::at(
                opportunities_ns.len(),
                ContactProblem::NoPeriod,
            ));
        }
        Ok(CapacityTrace { opportunities_ns })
    }

    /// The opportunities of the first period, in nanoseconds from its beginning. At least one.
    pub fn opportunities_ns(&self) -> &[u64] {
        &self.opportunities_ns
    }

    /// After this time the trace begins anew. At least 1 ms.
    pub fn period(&self) -> SimDuration {
        SimDuration::from_nanos(self.period_ns())
    }

    /// The mean rate, rounded down \[bit/s\].
    pub fn mean_rate_bit_per_s(&self) -> u64 {
        let bits = self.opportunities_ns.len() as u128 * u128::from(Self::PACKET_BYTES) * 8;
        saturated(bits * 1_000_000_000 / u128::from(self.period_ns()))
    }

    /// The longest time between two opportunities that follow each other, over the seam between
    /// periods, too.
    pub fn longest_gap(&self) -> SimDuration {
        // The last opportunity of a period lies at its end, where the next period begins.
        let seam = self.opportunities_ns[0];
        let inside = self.opportunities_ns.windows(2).map(|two| two[1] - two[0]);
        SimDuration::from_nanos(inside.fold(seam, u64::max))
    }

    /// When the `n`th opportunity is, from 0; [`SimTime::MAX`] if time ends before it. Exact, in
    /// constant time.
    pub fn opportunity(&self, n: u64) -> SimTime {
        let each = self.opportunities_ns.len() as u64;
        let (periods, rest) = (n / each, (n % each) as usize);
        let nanos = u128::from(periods) * u128::from(self.period_ns())
            + u128::from(self.opportunities_ns[rest]);
        SimTime::from_nanos(saturated(nanos))
    }

    /// The number of the first opportunity at `from` or later. Exact, in logarithmic time.
    pub fn first_from(&self, from: SimTime) -> u64 {
        let from = from.as_nanos();
        if from == 0 {
            return 0;
        }
        // An opportunity at the end of a period belongs to that period: count those before `from`.
        let (periods, rest) = ((from - 1) / self.period_ns(), (from - 1) % self.period_ns());
        let before = self.opportunities_ns.partition_point(|at| *at <= rest);
        let each = self.opportunities_ns.len() as u128;
        saturated(u128::from(periods) * each + before as u128)
    }

    /// When the first opportunity at `from` or later is.
    pub fn next_opportunity(&self, from: SimTime) -> SimTime {
        self.opportunity(self.first_from(from))
    }

    fn period_ns(&self) -> u64 {
        *self
            .opportunities_ns
            .last()
            .expect("a trace has at least one stamp")
    }
}

impl fmt::Debug for CapacityTrace {
    // A million stamps help nobody.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("CapacityTrace")
            .field("opportunities", &self.opportunities_ns.len())
            .field("period", &self.period())
            .finish()
    }
}

impl fmt::Display for CapacityTrace {
    /// `3 packets of 1500 bytes in 10ms, 3600000 bit/s on average, longest gap 7ms`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} packets of {} bytes in {}, {} bit/s on average, longest gap {}",
            self.opportunities_ns.len(),
            Self::PACKET_BYTES,
            self.period(),
            self.mean_rate_bit_per_s(),
            self.longest_gap()
        )
    }
}

/// The millisecond on a line.
fn stamp(line: &str, number: usize) -> Result<u64, ContactError> {
    let text = line.trim();
    let bad = |expected| {
        let found = shown(text);
        let field = "stamp";
        ContactError::at(
            number,
            ContactProblem::Field {
                field,
                found,
                expected,
            },
        )
    };
    let is_whole = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    match scaled(text, 0) {
        Ok(stamp) if is_whole && stamp <= MAX_STAMP_MS => Ok(stamp),
        Err(NumberError::TooLarge) | Ok(_) if is_whole => Err(bad("milliseconds within a year")),
        _ => Err(bad("a whole number of milliseconds, one to a line")),
    }
}

fn saturated(value: u128) -> u64 {
    u64::try_from(value).unwrap_or(u64::MAX)
}
