//! The stages of a link: each asks one question about one message, and draws under a purpose of
//! its own, so that a stage added or switched off leaves the draws of the others where they were.

use farside::SimDuration;
use farside::carrier::Parcel;
use farside::random::RandomKey;

use super::{JitterShape, LinkParams};

/// What a draw is for. The numbers are part of every run's identity: add, never renumber.
#[derive(Clone, Copy)]
enum Purpose {
    Loss = 1,
    Jitter = 2,
    Duplicate = 3,
}

fn draw(parcel: &Parcel<'_>, purpose: Purpose, copy: u32) -> RandomKey {
    parcel.random(purpose as u64, 0, copy)
}

/// How many copies of the message set out: one, or two.
pub fn copies(params: &LinkParams, parcel: &Parcel<'_>) -> u32 {
    let twice =
        params.duplicate > 0.0 && draw(parcel, Purpose::Duplicate, 0).uniform() < params.duplicate;
    1 + u32::from(twice)
}

/// Whether this copy is lost. Below one draw lie all smaller loss rates: whoever is lost at 10 %
/// is lost at 20 % too.
pub fn is_lost(params: &LinkParams, parcel: &Parcel<'_>, copy: u32) -> bool {
    params.loss > 0.0 && draw(parcel, Purpose::Loss, copy).uniform() < params.loss
}

/// How long this copy takes.
pub fn delay(params: &LinkParams, parcel: &Parcel<'_>, copy: u32) -> SimDuration {
    if params.jitter.is_zero() {
        return params.latency.max(params.min_delay());
    }
    let key = draw(parcel, Purpose::Jitter, copy);
    // In units of `jitter`, within the spread that bounds the shape.
    let deviation = match params.jitter_shape {
        JitterShape::Uniform => 2.0 * key.uniform() - 1.0,
        JitterShape::Normal => {
            let spread = f64::from(JitterShape::NORMAL_SPREAD);
            key.stream().normal(0.0, 1.0).clamp(-spread, spread)
        }
    };
    let offset = deviation * params.jitter.as_nanos() as f64;
    let size = SimDuration::from_nanos(offset.abs() as u64);
    let delay = if offset < 0.0 {
        params.latency - size
    } else {
        params.latency + size
    };
    delay.max(params.min_delay())
}
