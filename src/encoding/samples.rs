//! Values to hand to a type's `Deserialize` while it is traced.
//!
//! Most types take the first. Types that validate get others: first the same sample everywhere,
//! then different ones in different places, so that `low < high` is met sooner or later.

const INTEGERS: [u8; 10] = [0, 1, 2, 3, 5, 7, 10, 100, 64, 16];
const REALS: [f64; 10] = [0.0, 1.0, 0.5, 2.0, -1.0, 0.1, 3.0, 10.0, 100.0, 90.0];
const CHARS: [char; 5] = ['a', 'A', '0', ' ', '\0'];
const STRINGS: [&str; 14] = [
    "",
    "a",
    "0",
    "1",
    "A",
    "1s",
    "0.5",
    "a.b",
    "a/b",
    "127.0.0.1",
    "::1",
    "127.0.0.1:80",
    "1970-01-01T00:00:00Z",
    "00000000-0000-0000-0000-000000000000",
];
const ZEROS: [u8; 64] = [0; 64];
const LENGTHS: [usize; 8] = [0, 16, 4, 1, 8, 32, 12, 64];

/// Which sample to give: how many were refused here or further out, and where "here" is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    pub(super) tries: u32,
    pub(super) site: u64,
}

impl Sample {
    fn of<T: Copy>(self, all: &[T]) -> T {
        let tries = self.tries as usize;
        // Once all were tried alike, the place joins in.
        let at = if tries < all.len() {
            tries
        } else {
            mix(self.site, self.tries.into()) as usize
        };
        all[at % all.len()]
    }

    pub(super) fn integer(self) -> u8 {
        self.of(&INTEGERS)
    }

    pub(super) fn real(self) -> f64 {
        self.of(&REALS)
    }

    pub(super) fn char(self) -> char {
        self.of(&CHARS)
    }

    pub(super) fn string(self) -> &'static str {
        self.of(&STRINGS)
    }

    pub(super) fn bytes(self) -> &'static [u8] {
        &ZEROS[..self.of(&LENGTHS)]
    }
}

/// Derives a place from the one around it.
pub(super) fn mix(site: u64, step: u64) -> u64 {
    let mixed =
        (site ^ step.wrapping_mul(0x9e37_79b9_7f4a_7c15)).wrapping_add(0x632b_e59b_d9b4_e019);
    let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    mixed ^ (mixed >> 32)
}
