//! The running digest: a chain, in key order, over each handled event and each fate.
//!
//! Names enter as hashes of their text and bodies as canonical protobuf, so the digest depends on
//! what happened and not on how things are numbered or stored.

use std::fmt;

use serde::{Deserialize, Serialize};

/// The digest of a run so far: 128 bits, printed as 32 hexadecimal digits.
///
/// ```
/// use farside::Digest;
/// let digest: Digest = "000102030405060708090a0b0c0d0e0f".parse().unwrap();
/// assert_eq!(digest.to_string(), "000102030405060708090a0b0c0d0e0f");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct Digest(u128);

impl Digest {
    /// The digest of a run in which nothing has happened.
    pub const EMPTY: Digest = Digest(0x6661_7273_6964_6521_6661_7273_6964_6521);

    /// The digest after one more record with the given hash: a polynomial in the hashes over
    /// 2^128, so that order counts.
    pub(crate) fn extend(&mut self, hash: u128) {
        const FACTOR: u128 = 0x9E37_79B9_7F4A_7C15_F39C_C060_5CED_C835;
        self.0 = (self.0 ^ hash)
            .wrapping_mul(FACTOR)
            .rotate_left(29)
            .wrapping_add(hash);
    }
}

impl fmt::Display for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

impl std::str::FromStr for Digest {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match u128::from_str_radix(text, 16) {
            Ok(bits) if text.len() == 32 => Ok(Digest(bits)),
            _ => Err(format!("a digest is 32 hexadecimal digits, not {text:?}")),
        }
    }
}

impl From<Digest> for String {
    fn from(digest: Digest) -> String {
        digest.to_string()
    }
}

impl TryFrom<String> for Digest {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}
