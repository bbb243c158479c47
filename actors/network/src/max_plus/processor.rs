//! How fast a sensor node computes: its processor's operations are pairs of candidate paths. A pair
//! is looked at once when its payoff is made (section 3.4 of the paper: do the paths collide?), and
//! once for each max-plus vector that it has part in, in each iteration. Short cuts that this
//! program takes do not count. For serde's `with`: `"paper"` is a speed too.

use farside_actors::processor::Speed;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// The speed at which the paper's Table 1 comes out well; `"paper"` in a scenario. Fitted to it by
/// eye, on the dense roadmap with perfect links and few seeds: at 300k/s it fits less well, at
/// 500k/s about as well, and at 800k/s nothing deadlocks at 28 nodes. The paper gave each node a
/// core of 2.6 GHz and does not say what its program did with it.
pub const PAPER_SPEED: Speed = Speed::PerS(400_000);

/// What a node's processor is called: it is `{node}/planner`.
pub(crate) const PLANNER: &str = "planner";

pub(super) fn serialize<S: Serializer>(speed: &Speed, to: S) -> Result<S::Ok, S::Error> {
    speed.serialize(to)
}

pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Speed, D::Error> {
    let text = String::deserialize(from)?;
    match text.trim() {
        "paper" => Ok(PAPER_SPEED),
        other => other.parse().map_err(D::Error::custom),
    }
}
