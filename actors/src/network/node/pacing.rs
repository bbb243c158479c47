//! Max-plus over links with a bit rate. What a node says in one iteration is better than what it said in
//! the one before, and vectors that queue behind each other are old when they come, while
//! grants and beacons queue behind them. So a node computes no iteration before the vectors of the
//! last are on the air, by its own reckoning with the slowest link's rate, and does not send what
//! would not be on the air when the optimisation is over. Nothing changes where links have no rate.

use std::sync::LazyLock;

use farside::SimDuration;
use farside::encoding::{Schema, SchemaError};
use serde::Serialize;

use crate::network::messages::{CandidatePaths, MaxPlus};
use crate::network::timing::Timing;

type Known = LazyLock<Result<Schema, SchemaError>>;

static PATHS: Known = LazyLock::new(Schema::of::<CandidatePaths>);
static VECTORS: Known = LazyLock::new(Schema::of::<MaxPlus>);

/// How long candidate paths are on the air.
pub(super) fn paths_take(timing: &Timing, message: &CandidatePaths) -> SimDuration {
    takes(timing, &PATHS, message)
}

/// How long vectors are on the air.
pub(super) fn vectors_take(timing: &Timing, message: &MaxPlus) -> SimDuration {
    takes(timing, &VECTORS, message)
}

fn takes<M: Serialize>(timing: &Timing, schema: &Known, message: &M) -> SimDuration {
    // Only a rate makes a size worth knowing.
    let (Some(_), Ok(schema)) = (timing.rate_bit_per_s, &**schema) else {
        return SimDuration::ZERO;
    };
    let mut bytes = Vec::new();
    // What cannot be encoded ends the run where it is recorded.
    let _ = schema.encode(message, &mut bytes);
    timing.sending(bytes.len() as u64)
}
