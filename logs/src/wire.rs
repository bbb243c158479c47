//! The few parts of protobuf's wire format that the envelope needs, written and read by hand.

/// A field of a message being read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Value<'a> {
    Varint(u64),
    Bytes(&'a [u8]),
    Fixed32(u32),
    Fixed64(u64),
    /// The fields of a group, without its end.
    Group(&'a [u8]),
}

impl<'a> Value<'a> {
    pub(crate) fn number(self) -> Option<u64> {
        match self {
            Value::Varint(value) => Some(value),
            _ => None,
        }
    }

    pub(crate) fn double(self) -> Option<f64> {
        match self {
            Value::Fixed64(bits) => Some(f64::from_bits(bits)),
            _ => None,
        }
    }

    pub(crate) fn bytes(self) -> Option<&'a [u8]> {
        match self {
            Value::Bytes(bytes) => Some(bytes),
            _ => None,
        }
    }

    pub(crate) fn text(self) -> Option<&'a str> {
        self.bytes()
            .and_then(|bytes| std::str::from_utf8(bytes).ok())
    }
}

#[inline]
pub(crate) fn put_varint(out: &mut Vec<u8>, value: u64) {
    if value < 0x80 {
        out.push(value as u8);
        return;
    }
    let length = varint_len(value);
    // Eight groups of seven bits, each moved into a byte of its own: first apart by four bits, then
    // by two, then by one.
    let apart = value & 0x0fff_ffff | (value & 0xff_ffff_f000_0000) << 4;
    let apart = apart & 0x0000_3fff_0000_3fff | (apart & 0x0fff_c000_0fff_c000) << 2;
    let apart = apart & 0x007f_007f_007f_007f | (apart & 0x3f80_3f80_3f80_3f80) << 1;
    let start = out.len();
    // Ten bytes, and what is too much off again: copying a fixed number of bytes needs no call.
    let mut bytes = [0x80; 10];
    bytes[..8].copy_from_slice(&(apart | 0x8080_8080_8080_8080).to_le_bytes());
    bytes[8] |= (value >> 56) as u8;
    bytes[9] = (value >> 63) as u8;
    bytes[length - 1] &= 0x7f;
    out.extend_from_slice(&bytes);
    out.truncate(start + length);
}

pub(crate) fn varint_len(value: u64) -> usize {
    let bits = 64 - (value | 1).leading_zeros() as usize;
    bits.div_ceil(7)
}

/// A number field; zero is left out, as proto3 has it.
#[inline]
pub(crate) fn put_number(out: &mut Vec<u8>, field: u32, value: u64) {
    if value != 0 {
        put_varint(out, u64::from(field) << 3);
        put_varint(out, value);
    }
}

/// A signed number field, zigzag; zero is left out.
pub(crate) fn put_signed(out: &mut Vec<u8>, field: u32, value: i64) {
    put_number(out, field, (value << 1 ^ value >> 63) as u64);
}

/// The signed number that [`put_signed`] wrote as this one.
pub(crate) fn signed(value: u64) -> i64 {
    (value >> 1) as i64 ^ -((value & 1) as i64)
}

/// A double field; zero is left out.
pub(crate) fn put_double(out: &mut Vec<u8>, field: u32, value: f64) {
    if value != 0.0 {
        put_varint(out, u64::from(field) << 3 | 1);
        out.extend_from_slice(&value.to_le_bytes());
    }
}

/// A string, bytes or message field.
pub(crate) fn put_bytes(out: &mut Vec<u8>, field: u32, bytes: &[u8]) {
    put_varint(out, u64::from(field) << 3 | 2);
    put_varint(out, bytes.len() as u64);
    out.extend_from_slice(bytes);
}

/// A string field; the empty string is left out.
pub(crate) fn put_text(out: &mut Vec<u8>, field: u32, text: &str) {
    if !text.is_empty() {
        put_bytes(out, field, text.as_bytes());
    }
}

/// Reads the fields of a message, one after the other; `Err` where the bytes are no message.
pub(crate) struct Fields<'a> {
    rest: &'a [u8],
}

impl<'a> Fields<'a> {
    pub(crate) fn new(message: &'a [u8]) -> Self {
        Fields { rest: message }
    }

    /// What is not read yet.
    pub(crate) fn rest(&self) -> &'a [u8] {
        self.rest
    }

    #[inline]
    pub(crate) fn varint(&mut self) -> Option<u64> {
        match self.rest {
            [byte @ ..0x80, rest @ ..] => {
                self.rest = rest;
                Some(u64::from(*byte))
            }
            _ => self.long_varint(),
        }
    }

    fn long_varint(&mut self) -> Option<u64> {
        let mut value = 0u64;
        for (at, byte) in self.rest.iter().take(10).enumerate() {
            value |= u64::from(byte & 0x7f) << (7 * at).min(63);
            if byte & 0x80 == 0 {
                self.rest = &self.rest[at + 1..];
                return Some(value);
            }
        }
        None
    }

    fn take(&mut self, length: u64) -> Option<&'a [u8]> {
        let length = usize::try_from(length).ok()?;
        let (taken, rest) = self.rest.split_at_checked(length)?;
        self.rest = rest;
        Some(taken)
    }

    /// The fields up to the end of the group that has just started; groups within it are passed
    /// over without recursion, however deep they are.
    fn group(&mut self, number: u32) -> Option<&'a [u8]> {
        let start = self.rest;
        let mut open = vec![number];
        while let Some(inner) = open.last().copied() {
            let before = self.rest.len();
            let tag = self.varint()?;
            let field = u32::try_from(tag >> 3).ok()?;
            match tag & 7 {
                0 => drop(self.varint()?),
                1 => drop(self.take(8)?),
                2 => {
                    let length = self.varint()?;
                    self.take(length)?;
                }
                3 => open.push(field),
                4 if field == inner => {
                    open.pop();
                    if open.is_empty() {
                        return start.get(..start.len() - before);
                    }
                }
                5 => drop(self.take(4)?),
                _ => return None,
            }
        }
        None
    }

    fn field(&mut self) -> Option<(u32, Value<'a>)> {
        let tag = self.varint()?;
        let number = u32::try_from(tag >> 3).ok()?;
        let value = match tag & 7 {
            3 => Value::Group(self.group(number)?),
            0 => Value::Varint(self.varint()?),
            1 => Value::Fixed64(u64::from_le_bytes(self.take(8)?.try_into().ok()?)),
            2 => {
                let length = self.varint()?;
                Value::Bytes(self.take(length)?)
            }
            5 => Value::Fixed32(u32::from_le_bytes(self.take(4)?.try_into().ok()?)),
            _ => return None,
        };
        Some((number, value))
    }
}

impl<'a> Iterator for Fields<'a> {
    type Item = Result<(u32, Value<'a>), ()>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.rest.is_empty() {
            return None;
        }
        let field = self.field();
        if field.is_none() {
            self.rest = &[];
        }
        Some(field.ok_or(()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let mut out = Vec::new();
        for value in [1, 0x7f, 0x80, 1 << 35, u64::MAX] {
            let start = out.len();
            put_varint(&mut out, value);
            assert_eq!(out.len() - start, varint_len(value));
            out.truncate(start);
            put_number(&mut out, 3, value);
        }
        put_text(&mut out, 4, "rover_1");
        let read: Vec<_> = Fields::new(&out).map(Result::unwrap).collect();
        assert_eq!(read.len(), 6);
        assert_eq!(read[4], (3, Value::Varint(u64::MAX)));
        assert_eq!(read[5].1.text(), Some("rover_1"));
    }

    #[test]
    fn numbers_are_written_as_protobuf_has_them() {
        // By the definition: seven bits a byte, the least first, a bit for "more follows".
        let slowly = |mut value: u64| {
            let mut out = Vec::new();
            while value >= 0x80 {
                out.push(value as u8 | 0x80);
                value >>= 7;
            }
            out.push(value as u8);
            out
        };
        let near =
            (0..64).flat_map(|bit| [(1u64 << bit) - 1, 1 << bit, 0xdead_beef_cafe_f00d >> bit]);
        for value in near.chain([u64::MAX]) {
            let mut out = vec![1];
            put_varint(&mut out, value);
            assert_eq!(out[1..], slowly(value), "{value:#x}");
        }
    }

    #[test]
    fn signs_survive() {
        for value in [0, 1, -1, 63, -64, i64::MAX, i64::MIN] {
            let mut out = Vec::new();
            put_signed(&mut out, 1, value);
            let read = Fields::new(&out).next().map(Result::unwrap);
            let number = read.map_or(0, |(_, number)| number.number().unwrap());
            assert_eq!(signed(number), value);
        }
    }

    #[test]
    fn lengths_beyond_the_end_are_refused() {
        assert_eq!(Fields::new(&[0x0a, 5, 1]).collect::<Vec<_>>(), [Err(())]);
        assert_eq!(Fields::new(&[0x80; 12]).collect::<Vec<_>>(), [Err(())]);
    }
}
