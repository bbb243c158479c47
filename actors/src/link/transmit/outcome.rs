//! What becomes of a transmission and of a message, and what the world between two antennas adds to
//! it.

use farside::carrier::{Carriage, Verdicts};
use farside::{SimDuration, SimTime};

/// What the world between two antennas adds to the parameters of a link. The default adds nothing.
///
/// ```
/// use farside::SimDuration;
/// use farside_actors::link::Path;
/// // 300 km apart, and a tenth lost for want of signal.
/// let path = Path { propagation: SimDuration::from_millis(1), loss: 0.1, ..Path::default() };
/// assert_eq!(path.reason, "range");
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Path {
    /// The time on the way beside the latency: the distance over the speed of light.
    pub propagation: SimDuration,
    /// The probability that a transmission is lost on this path, beside all other losses.
    pub loss: f64,
    /// Why it is lost then.
    pub reason: &'static str,
    /// The most bits per second that it carries, if that is less than the link's rate.
    pub rate: Option<u64>,
}

impl Default for Path {
    fn default() -> Self {
        Path {
            propagation: SimDuration::ZERO,
            loss: 0.0,
            reason: "range",
            rate: None,
        }
    }
}

/// One transmission, and what became of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attempt {
    /// When it begins.
    pub start: SimTime,
    /// When the channel is free again: its last bit has left, or it was cut.
    pub end: SimTime,
    /// When it arrives, or when its loss shows.
    pub at: SimTime,
    /// The time on the way without jitter; none if it did not get so far.
    pub propagation: SimDuration,
    /// Why it failed, if it did.
    pub failed: Option<&'static str>,
    /// Whether anything went on the air.
    pub sent: bool,
    /// What it took from the sender \[J\].
    pub energy_j: f64,
    /// What it takes from the receiver, if it gets through \[J\].
    pub receive_j: f64,
    /// The time that an answer takes to come back.
    pub(super) answer: SimDuration,
}

impl Attempt {
    /// How long the message is on its way if nothing else happens, and an answer too.
    pub(in crate::link) fn way(&self) -> SimDuration {
        self.answer
    }

    /// When the sender has an answer, if it waits for one: the answer takes the propagation back,
    /// has no jitter, and is never lost.
    pub fn answered(&self) -> SimTime {
        self.end + self.answer + self.answer
    }

    /// How it was carried, from its start on: what came before, a caller adds.
    pub fn parts(&self) -> Carriage {
        let way = self.at.since(self.end);
        Carriage {
            serialization: self.end.since(self.start),
            propagation: self.propagation,
            jitter_ns: difference(way, self.propagation),
            attempts: u32::from(self.sent),
            energy_j: self.energy_j,
            receive_j: self.receive_j,
            ..Carriage::default()
        }
    }
}

/// What became of a message: when, why not, and how it was carried.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sent {
    /// When it arrives, or when it is lost.
    pub at: SimTime,
    /// Why it is lost, if it is.
    pub lost: Option<&'static str>,
    /// The parts of its delay; their sum is `at` less the instant it was sent.
    pub carriage: Carriage,
}

impl Sent {
    /// Tells the kernel, at `now`, and charges the sender.
    pub fn tell(&self, now: SimTime, verdicts: &mut Verdicts) {
        let after = self.at.since(now);
        match self.lost {
            None => verdicts.deliver_as(after, self.carriage),
            Some(reason) => verdicts.lose_as(after, reason, self.carriage),
        }
        verdicts.charge(self.carriage.energy_j);
    }
}

/// `a - b` in nanoseconds.
pub(crate) fn difference(a: SimDuration, b: SimDuration) -> i64 {
    let (a, b) = (a.as_nanos() as i64, b.as_nanos() as i64);
    a.wrapping_sub(b)
}
