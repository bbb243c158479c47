//! Which messages of two logs differ, one by one: for who shows both logs.

use super::found::Found;
use crate::any::AnyMessage;
use crate::scan::Position;

/// As many messages of a log as are kept.
const MOST: usize = 1 << 20;

/// The messages of two logs that the other log has otherwise, or not.
#[derive(Debug, Default)]
pub struct Differing {
    /// Of each log, where they are; sorted.
    places: [Vec<Position>; 2],
    left_out: u64,
}

impl Differing {
    /// Whether a message of the first log (0) or of the second (1) differs.
    pub fn has(&self, log: usize, message: &AnyMessage<'_>) -> bool {
        self.places[log].binary_search(&message.position()).is_ok()
    }

    /// How many differ and are not kept: there is a bound.
    pub fn left_out(&self) -> u64 {
        self.left_out
    }

    pub(super) fn add(&mut self, found: &Found) {
        for (places, entry) in self.places.iter_mut().zip(found.both()) {
            let Some(entry) = entry else {
                continue;
            };
            match places.len() < MOST {
                true => places.push(entry.position),
                false => self.left_out += 1,
            }
        }
    }

    pub(super) fn sort(&mut self) {
        for places in &mut self.places {
            places.sort_unstable();
        }
    }
}
