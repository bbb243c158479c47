//! The one message of open-loop traffic, and how it comes to be of an exact size.

use farside::{MatchKey, SimTime};
use serde::{Deserialize, Serialize};

/// A message of a flow. Encoded, it has exactly the size that was asked for.
///
/// ```
/// use farside::SimTime;
/// use farside::encoding::Schema;
/// use farside_traffic::Datagram;
/// let schema = Schema::of::<Datagram>()?;
/// let datagram = Datagram::of_size(7, 1000, SimTime::from_nanos(1 << 40), 200);
/// let mut bytes = Vec::new();
/// schema.encode(&datagram, &mut bytes)?;
/// assert_eq!(bytes.len(), 200);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Datagram {
    /// The flow's id, see [`super::Flow::id`].
    pub flow: u32,
    /// Its place in the flow, from 0.
    pub number: u32,
    /// When its source sent it \[ns\].
    pub sent_ns: u64,
    /// 0, or 128 where one byte more is needed than padding can give.
    pub slack: u32,
    /// What fills the message to its size.
    pub padding: String,
}

impl Datagram {
    /// The least size \[byte\]: below, a message late in a long run would not fit.
    pub const MIN_SIZE_BYTES: u64 = 40;

    /// The greatest size \[byte\].
    pub const MAX_SIZE_BYTES: u64 = 1 << 20;

    /// A message whose encoding has `size_bytes`, from [`Datagram::MIN_SIZE_BYTES`] to
    /// [`Datagram::MAX_SIZE_BYTES`].
    ///
    /// # Panics
    /// When the size is out of this range.
    pub fn of_size(flow: u32, number: u32, sent: SimTime, size_bytes: u64) -> Datagram {
        assert!(
            (Self::MIN_SIZE_BYTES..=Self::MAX_SIZE_BYTES).contains(&size_bytes),
            "a datagram has {} to {} bytes, not {size_bytes}",
            Self::MIN_SIZE_BYTES,
            Self::MAX_SIZE_BYTES
        );
        let sent_ns = sent.as_nanos();
        let numbers = [u64::from(flow), u64::from(number), sent_ns];
        // Five fields, each with a tag of one byte; slack takes one byte at least.
        let fixed = 5 + 1 + numbers.into_iter().map(varint_bytes).sum::<u64>();
        let rest = size_bytes - fixed;
        // The padding and its length share the rest. The length grows a byte at 128, where one
        // size would be skipped: slack takes that byte.
        let mut padding = rest - 1;
        while padding + varint_bytes(padding) > rest {
            padding -= 1;
        }
        let slack = rest - padding - varint_bytes(padding);
        Datagram {
            flow,
            number,
            sent_ns,
            slack: 128 * slack as u32,
            padding: ".".repeat(padding as usize),
        }
    }

    /// What the message is known by on each hop, whatever else is sent.
    pub fn key(&self) -> MatchKey {
        MatchKey::new(self.flow, self.number)
    }
}

/// How many bytes protobuf takes for a number.
fn varint_bytes(number: u64) -> u64 {
    let bits = u64::from(64 - number.leading_zeros());
    bits.div_ceil(7).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use farside::encoding::Schema;
    use proptest::prelude::*;

    fn encoded(datagram: &Datagram) -> u64 {
        let mut bytes = Vec::new();
        let schema = Schema::of::<Datagram>().unwrap();
        schema.encode(datagram, &mut bytes).unwrap();
        bytes.len() as u64
    }

    #[test]
    fn every_size_round_the_steps_of_the_length_is_exact() {
        let sizes = (40..400)
            .chain(16_380..16_440)
            .chain([1 << 20, (1 << 20) - 1]);
        for size in sizes {
            let datagram = Datagram::of_size(3, 9, SimTime::from_nanos(1), size);
            assert_eq!(encoded(&datagram), size);
        }
    }

    proptest! {
        #[test]
        fn any_message_has_its_size(flow: u32, number: u32, sent: u64, size in 40u64..40_000) {
            let datagram = Datagram::of_size(flow, number, SimTime::from_nanos(sent), size);
            prop_assert_eq!(encoded(&datagram), size);
        }
    }
}
