//! A rover's memory: filled by readings, emptied by transmitting. It holds amounts, not data.

/// The memory of a rover, in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Memory {
    size_bytes: u64,
    /// What is out of order.
    broken_bytes: u64,
    used_bytes: u64,
    /// All that ever was stored, sent and lost: what is held is the first less the others.
    pub(super) stored_bytes: u64,
    pub(super) sent_bytes: u64,
    pub(super) lost_bytes: u64,
}

impl Memory {
    pub(super) fn new(size_bytes: u64) -> Memory {
        Memory {
            size_bytes,
            broken_bytes: 0,
            used_bytes: 0,
            stored_bytes: 0,
            sent_bytes: 0,
            lost_bytes: 0,
        }
    }

    pub(super) fn used_bytes(&self) -> u64 {
        self.used_bytes
    }

    /// What it can hold, as it is now.
    pub(super) fn capacity_bytes(&self) -> u64 {
        self.size_bytes - self.broken_bytes
    }

    pub(super) fn free_bytes(&self) -> u64 {
        self.capacity_bytes() - self.used_bytes
    }

    /// Stores so much; false, and nothing changes, if it does not fit.
    pub(super) fn store(&mut self, bytes: u64) -> bool {
        let fits = bytes <= self.free_bytes();
        if fits {
            self.used_bytes += bytes;
            self.stored_bytes += bytes;
        }
        fits
    }

    /// Frees so much, or what there is.
    pub(super) fn send(&mut self, bytes: u64) {
        let sent = bytes.min(self.used_bytes);
        self.used_bytes -= sent;
        self.sent_bytes += sent;
    }

    /// Puts this share of it out of order, and no other. Returns how much was lost because it no
    /// longer fits.
    pub(super) fn set_broken(&mut self, share: f64) -> u64 {
        let broken = (self.size_bytes as f64 * share.clamp(0.0, 1.0)) as u64;
        self.broken_bytes = broken.min(self.size_bytes);
        let lost = self.used_bytes.saturating_sub(self.capacity_bytes());
        self.used_bytes -= lost;
        self.lost_bytes += lost;
        lost
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[derive(Clone, Copy, Debug)]
    enum Edit {
        Store(u64),
        Send(u64),
        Break(f64),
    }

    fn edits() -> impl Strategy<Value = Vec<Edit>> {
        let edit = prop_oneof![
            (0u64..400).prop_map(Edit::Store),
            (0u64..400).prop_map(Edit::Send),
            (-0.5f64..1.5).prop_map(Edit::Break),
        ];
        prop::collection::vec(edit, 0..40)
    }

    proptest! {
        #[test]
        fn it_is_never_outside_its_bounds_and_nothing_vanishes(edits in edits()) {
            let mut memory = Memory::new(1000);
            for edit in edits {
                let (before, free) = (memory.used_bytes(), memory.free_bytes());
                match edit {
                    Edit::Store(bytes) => prop_assert_eq!(memory.store(bytes), bytes <= free),
                    Edit::Send(bytes) => memory.send(bytes),
                    Edit::Break(share) => {
                        let lost = memory.set_broken(share);
                        prop_assert_eq!(before - memory.used_bytes(), lost);
                    }
                }
                prop_assert!(memory.used_bytes() <= memory.capacity_bytes());
                prop_assert!(memory.capacity_bytes() <= 1000);
                let held = memory.stored_bytes - memory.sent_bytes - memory.lost_bytes;
                prop_assert_eq!(memory.used_bytes(), held);
            }
        }
    }
}
