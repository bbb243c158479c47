//! Numbers as columns of a page: integers of variable length, compressed, as text.
//!
//! A block is bytes, compressed as zlib does and written in base 64, so that nothing in it can be taken for markup
//! whatever it says. `assets/data.js` reads it.

use std::io::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::ZlibEncoder;

/// A column: integers, seven bits a byte, the least significant first, with the eighth bit set in all bytes of a
/// number but the last.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Column {
    bytes: Vec<u8>,
}

impl Column {
    /// Appends a number.
    pub(super) fn push(&mut self, mut number: u64) {
        while number >= 0x80 {
            self.bytes.push(number as u8 | 0x80);
            number >>= 7;
        }
        self.bytes.push(number as u8);
    }

    /// Appends a number with a sign: 0, -1, 1, -2, ... are 0, 1, 2, 3, ...
    pub(super) fn push_signed(&mut self, number: i64) {
        self.push(zigzag(number));
    }

    pub(super) fn bytes(&self) -> &[u8] {
        &self.bytes
    }
}

fn zigzag(number: i64) -> u64 {
    ((number << 1) ^ (number >> 63)) as u64
}

/// Bytes as a block of a page.
pub(super) fn block(bytes: &[u8]) -> String {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::new(6));
    let written = encoder.write_all(bytes).and_then(|()| encoder.finish());
    // Only what is written to can fail, and memory does not.
    let packed = written.expect("memory takes what is written to it");
    STANDARD.encode(packed)
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use super::*;

    /// What the page's script does, in the same order.
    fn unpacked(text: &str) -> Vec<u8> {
        let packed = STANDARD.decode(text).unwrap();
        let mut bytes = Vec::new();
        flate2::read::ZlibDecoder::new(packed.as_slice())
            .read_to_end(&mut bytes)
            .unwrap();
        bytes
    }

    fn numbers(bytes: &[u8]) -> Vec<u64> {
        let mut all = Vec::new();
        let (mut number, mut shift) = (0_u64, 0);
        for byte in bytes {
            number |= u64::from(byte & 0x7f) << shift;
            shift += 7;
            if byte & 0x80 == 0 {
                all.push(number);
                (number, shift) = (0, 0);
            }
        }
        all
    }

    #[test]
    fn what_is_pushed_comes_back() {
        let given = [0, 1, 127, 128, 300, u64::from(u32::MAX), u64::MAX];
        let mut column = Column::default();
        given.iter().for_each(|number| column.push(*number));
        let text = block(column.bytes());
        assert_eq!(numbers(&unpacked(&text)), given);
        assert!(!text.contains(['<', '&', '"']), "{text}");
    }

    #[test]
    fn signs_alternate() {
        let small: Vec<u64> = [0, -1, 1, -2, 2].into_iter().map(zigzag).collect();
        assert_eq!(small, [0, 1, 2, 3, 4]);
        assert_eq!(zigzag(i64::MIN), u64::MAX);
    }
}
