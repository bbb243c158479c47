//! The draws of a link for a message, addressed once more after the run, by whoever asks what was drawn.

use crate::random::{RandomKey, name_hash};
use crate::ruling::{MessageId, MessageNumber};

/// Addresses what a link drew for a message, in the run with this seed: the same numbers as
/// [`Parcel::random`](super::Parcel::random) and [`Parcel::random_at`](super::Parcel::random_at) gave.
///
/// ```
/// use farside::carrier::DrawsOf;
/// let message = "node_03,rover_07,Grant,12".parse()?;
/// let draws = DrawsOf { seed: 1, link: "node_03-rover_07", message: &message };
/// let (first, again) = (draws.random(1, 0), draws.random(1, 1));
/// assert_ne!(first.uniform(), again.uniform());
/// # Ok::<(), farside::ruling::MessageIdError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct DrawsOf<'a> {
    /// The run's seed.
    pub seed: u64,
    /// The name of the link.
    pub link: &'a str,
    /// The message, and which copy of it. A message that has a key of its own is named by that.
    pub message: &'a MessageId,
}

impl DrawsOf<'_> {
    /// The address of a draw for this attempt of the copy.
    pub fn random(&self, purpose: u64, attempt: u32) -> RandomKey {
        let message = self.message;
        let (identity, turn) = identity(message.number);
        RandomKey::of([
            self.seed,
            identity,
            turn,
            name_hash(self.link),
            purpose,
            name_hash(&message.sender),
            name_hash(&message.receiver),
            name_hash(&message.kind),
            u64::from(attempt) << 32 | u64::from(message.copy),
        ])
    }

    /// The address of a draw of the link itself, whatever message asks.
    pub fn random_at(&self, purpose: u64, number: u64) -> RandomKey {
        at(self.seed, name_hash(self.link), purpose, number)
    }
}

/// What tells the message from others of its flow.
#[inline]
pub(super) fn identity(number: MessageNumber) -> (u64, u64) {
    match number {
        // Keeps a keyed message apart from an unkeyed one with an equal ordinal.
        MessageNumber::Key { key, repeat } => (key.bits(), u64::from(repeat) | 1 << 63),
        MessageNumber::Ordinal(ordinal) => (ordinal, 0),
    }
}

pub(super) fn at(seed: u64, link: u64, purpose: u64, number: u64) -> RandomKey {
    RandomKey::new(seed)
        .number(link)
        .number(purpose)
        .number(number)
}
