//! The numbers of rovers, and the names of actors that follow from numbers.

use serde::{Deserialize, Serialize};

/// The number of a rover, from 0; its actor is called `rover_` and the number plus one, and so is it
/// written in messages.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize,
)]
#[serde(transparent)]
pub struct RoverId(#[serde(with = "farside_worlds::ids::numbered")] pub u32);

/// The name of one of `count` actors of a kind by its number from 0: `node_01`, ..., with as many
/// digits as the last number has, at least two, so that the order of names is that of numbers.
pub(crate) fn name(kind: &str, number: u32, count: u32) -> String {
    let (number, digits) = (number + 1, count.to_string().len().max(2));
    format!("{kind}_{number:0digits$}")
}
