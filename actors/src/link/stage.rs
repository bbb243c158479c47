//! The draws of a link: each asks one question about one copy of a message, under a purpose of its
//! own, so that a parameter added or switched off leaves the draws of the others where they were.

use farside::SimDuration;
use farside::carrier::Parcel;
use farside::random::RandomKey;

use super::{LinkParams, jitter};

/// What a draw is for. The numbers are part of every run's identity: add, never renumber.
#[derive(Clone, Copy)]
pub(super) enum Purpose {
    Loss = 1,
    Jitter = 2,
    Duplicate = 3,
    Burst = 4,
    /// By slot, not by message.
    BurstSlot = 5,
    Corrupt = 6,
    BitErrors = 7,
    Reorder = 8,
    Path = 9,
    Ack = 10,
    AckBitErrors = 11,
    AckBurst = 12,
    /// By slot, not by message.
    AckBurstSlot = 13,
}

/// One transmission of one copy of a message, or of a fragment of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Draws {
    pub(super) attempt: u32,
    pub(super) copy: u32,
    /// 0 for the first fragment, and for a message as a whole.
    pub(super) fragment: u32,
}

impl Draws {
    /// The first transmission of this copy.
    pub(super) fn first(copy: u32) -> Self {
        Draws {
            attempt: 0,
            copy,
            fragment: 0,
        }
    }

    pub(super) fn key(self, parcel: &Parcel<'_>, purpose: Purpose) -> RandomKey {
        let key = parcel.random(purpose as u64, self.attempt, self.copy);
        match self.fragment {
            0 => key,
            fragment => key.number(u64::from(fragment)),
        }
    }

    /// Whether something of this probability happens. Below one draw lie all smaller
    /// probabilities: who is lost at 10 % is lost at 20 % too.
    pub(super) fn happens(self, parcel: &Parcel<'_>, purpose: Purpose, probability: f64) -> bool {
        probability > 0.0 && self.key(parcel, purpose).uniform() < probability
    }
}

/// What is transmitted at once: a message, or so many bytes of it.
#[derive(Clone, Copy, Debug)]
pub(super) enum Piece {
    Whole,
    Part(u64),
}

impl Piece {
    /// The bytes on the air. To ask for a whole message's costs an encoding.
    pub(super) fn bytes(self, params: &LinkParams, parcel: &Parcel<'_>) -> u64 {
        let own = match self {
            Piece::Whole => parcel.size_bytes(),
            Piece::Part(bytes) => bytes,
        };
        own.saturating_add(params.overhead)
    }
}

/// How many copies of the message set out: one, or two.
pub(super) fn copies(params: &LinkParams, parcel: &Parcel<'_>) -> u32 {
    let twice = Draws::first(0).happens(parcel, Purpose::Duplicate, params.duplicate);
    1 + u32::from(twice)
}

/// How long this copy is on its way, with jitter drawn for itself alone.
pub(super) fn way(
    params: &LinkParams,
    latency: SimDuration,
    floor: SimDuration,
    parcel: &Parcel<'_>,
    draws: Draws,
) -> SimDuration {
    if params.jitter.is_zero() {
        return latency.max(floor);
    }
    let deviation = params.jitter_shape.draw(draws.key(parcel, Purpose::Jitter));
    jitter::shifted(latency, params.jitter, deviation).max(floor)
}

/// The probability that a packet of so many bytes has a wrong bit: `1 - (1 - ber)^(8 bytes)`.
///
/// ```
/// use farside_actors::link::packet_error_rate;
/// assert!((packet_error_rate(1e-6, 125) - 0.000_999_5).abs() < 1e-9);
/// assert_eq!(packet_error_rate(1.0, 1), 1.0);
/// ```
pub fn packet_error_rate(ber: f64, bytes: u64) -> f64 {
    -libm::expm1(8.0 * bytes as f64 * libm::log1p(-ber))
}
