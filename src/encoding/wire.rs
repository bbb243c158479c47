//! Protobuf's wire format: varints, tags and payloads. It knows nothing of schemas.

/// How the bytes after a tag are delimited.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wire {
    /// One varint.
    Varint,
    /// Eight bytes.
    Fixed64,
    /// A length, then that many bytes.
    Bytes,
    /// Four bytes.
    Fixed32,
}

impl Wire {
    pub(super) fn code(self) -> u64 {
        match self {
            Wire::Varint => 0,
            Wire::Fixed64 => 1,
            Wire::Bytes => 2,
            Wire::Fixed32 => 5,
        }
    }

    fn of(code: u64) -> Option<Wire> {
        match code {
            0 => Some(Wire::Varint),
            1 => Some(Wire::Fixed64),
            2 => Some(Wire::Bytes),
            5 => Some(Wire::Fixed32),
            _ => None,
        }
    }
}

/// A field's tag, already encoded: the first `len` bytes of `bits`, little-endian.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tag {
    bits: u64,
    len: u32,
}

impl Tag {
    /// Writes nothing: for packed elements and for the root.
    pub(super) const NONE: Tag = Tag { bits: 0, len: 0 };

    pub(super) fn new(number: u32, wire: Wire) -> Tag {
        let value = u64::from(number) << 3 | wire.code();
        let len = varint_len(value);
        Tag {
            bits: spread(value, len),
            len: len as u32,
        }
    }

    pub(super) fn len(self) -> usize {
        self.len as usize
    }

    #[inline(always)]
    pub(super) fn put(self, out: &mut Vec<u8>) {
        if self.len == 1 {
            out.push(self.bits as u8);
        } else {
            out.extend_from_slice(&self.bits.to_le_bytes()[..self.len as usize]);
        }
    }
}

/// How many bytes `value` takes as a varint.
#[inline]
pub(super) fn varint_len(value: u64) -> usize {
    ((64 - (value | 1).leading_zeros() as usize) * 9 + 64) / 64
}

/// The low 56 bits of `value` in groups of seven, one to a byte, as a varint of `len` bytes has
/// them. Shifts and masks instead of a loop: the length of a varint is what a branch predictor
/// guesses worst.
#[inline]
fn spread(value: u64, len: usize) -> u64 {
    let x = (value & 0x0fff_ffff) | ((value & 0x00ff_ffff_f000_0000) << 4);
    let x = (x & 0x0000_3fff_0000_3fff) | ((x & 0x0fff_c000_0fff_c000) << 2);
    let x = (x & 0x007f_007f_007f_007f) | ((x & 0x3f80_3f80_3f80_3f80) << 1);
    let more = if len > 8 {
        u64::MAX
    } else {
        (1 << (8 * (len - 1))) - 1
    };
    x | (0x8080_8080_8080_8080 & more)
}

/// Appends `tag` and `value` as a varint. Small values under small tags are written in one go,
/// whatever bytes they take; the buffer's growth is left to the others, which need a call anyway.
#[inline(always)]
pub(super) fn put_varint(out: &mut Vec<u8>, tag: Tag, value: u64) {
    if value >= 0x4000 || tag.len > 1 || out.capacity() - out.len() < 4 {
        return put_long_varint(out, tag, value);
    }
    let more = u32::from(value >= 0x80);
    let varint = (value as u32 & 0x7f) | more << 7 | (value as u32 >> 7) << 8;
    let word = tag.bits as u32 | varint << (8 * tag.len);
    let end = out.len() + (tag.len + 1 + more) as usize;
    out.extend_from_slice(&word.to_le_bytes());
    out.truncate(end);
}

#[inline(never)]
fn put_long_varint(out: &mut Vec<u8>, tag: Tag, value: u64) {
    let len = varint_len(value);
    let low = u128::from(spread(value, len));
    // A whole word is stored and the excess cut off: a store of constant size needs no loop.
    let end = out.len() + tag.len as usize + len;
    if value < 1 << 56 {
        let word = u128::from(tag.bits) | low << (8 * tag.len);
        out.extend_from_slice(&word.to_le_bytes());
    } else {
        let ninth = (value >> 56 & 0x7f) | u64::from(len == 10) << 7;
        let high = u128::from(ninth | (value >> 63) << 8);
        let word = u128::from(tag.bits) | (low | high << 64) << (8 * tag.len);
        out.extend_from_slice(&word.to_le_bytes());
    }
    out.truncate(end);
}

/// Appends `tag` and eight bytes.
#[inline(always)]
pub(super) fn put_fixed64(out: &mut Vec<u8>, tag: Tag, bits: u64) {
    if tag.len == 0 {
        out.extend_from_slice(&bits.to_le_bytes());
    } else {
        let end = out.len() + tag.len as usize + 8;
        let word = u128::from(tag.bits) | u128::from(bits) << (8 * tag.len);
        out.extend_from_slice(&word.to_le_bytes());
        out.truncate(end);
    }
}

/// Appends `tag` and four bytes.
#[inline(always)]
pub(super) fn put_fixed32(out: &mut Vec<u8>, tag: Tag, bits: u32) {
    if tag.len != 0 {
        tag.put(out);
    }
    out.extend_from_slice(&bits.to_le_bytes());
}

/// Appends `tag`, a length and `bytes`.
#[inline]
pub(super) fn put_bytes(out: &mut Vec<u8>, tag: Tag, bytes: &[u8]) {
    put_varint(out, tag, bytes.len() as u64);
    out.extend_from_slice(bytes);
}

/// The value after a tag.
#[derive(Clone, Copy, Debug)]
pub(super) struct Payload<'b> {
    pub(super) wire: Wire,
    /// The number, for every wire type but `Bytes`.
    pub(super) bits: u64,
    /// The content, for `Bytes`.
    pub(super) bytes: &'b [u8],
}

impl<'b> Payload<'b> {
    /// What a reader must assume where a field is absent.
    pub(super) fn zero(wire: Wire) -> Payload<'b> {
        Payload {
            wire,
            bits: 0,
            bytes: &[],
        }
    }
}

/// Why bytes are no protobuf.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Malformed {
    /// They end inside a field.
    Cut,
    /// A varint has more than ten bytes.
    Varint,
    /// A tag has this code as its wire type, or field number 0.
    Tag(u64),
}

/// Reads one varint at `pos`, moving it. Most have one byte.
#[inline(always)]
pub(super) fn take_varint(bytes: &[u8], pos: &mut usize) -> Result<u64, Malformed> {
    match bytes.get(*pos) {
        Some(&byte) if byte < 0x80 => {
            *pos += 1;
            Ok(u64::from(byte))
        }
        _ => take_long_varint(bytes, pos),
    }
}

#[inline(never)]
fn take_long_varint(bytes: &[u8], pos: &mut usize) -> Result<u64, Malformed> {
    let mut value = 0;
    for shift in 0..10 {
        let byte = *bytes.get(*pos).ok_or(Malformed::Cut)?;
        *pos += 1;
        value |= u64::from(byte & 0x7f) << (7 * shift);
        if byte < 0x80 {
            // The tenth byte has room for one bit.
            return if shift == 9 && byte > 1 {
                Err(Malformed::Varint)
            } else {
                Ok(value)
            };
        }
    }
    Err(Malformed::Varint)
}

/// Reads a value of the given wire type at `pos`, moving it.
#[inline(always)]
pub(super) fn take_payload<'b>(
    bytes: &'b [u8],
    pos: &mut usize,
    wire: Wire,
) -> Result<Payload<'b>, Malformed> {
    let mut payload = Payload::zero(wire);
    match wire {
        Wire::Varint => payload.bits = take_varint(bytes, pos)?,
        Wire::Fixed64 => {
            let chunk = bytes[*pos..].first_chunk::<8>().ok_or(Malformed::Cut)?;
            payload.bits = u64::from_le_bytes(*chunk);
            *pos += 8;
        }
        Wire::Fixed32 => {
            let chunk = bytes[*pos..].first_chunk::<4>().ok_or(Malformed::Cut)?;
            payload.bits = u64::from(u32::from_le_bytes(*chunk));
            *pos += 4;
        }
        Wire::Bytes => {
            let len = take_varint(bytes, pos)?;
            let rest = &bytes[*pos..];
            let len = usize::try_from(len).ok().filter(|&len| len <= rest.len());
            payload.bytes = &rest[..len.ok_or(Malformed::Cut)?];
            *pos += payload.bytes.len();
        }
    }
    Ok(payload)
}

/// Reads one field at `pos`, moving it: its number and its value.
#[inline]
pub(super) fn take_field<'b>(
    bytes: &'b [u8],
    pos: &mut usize,
) -> Result<(u32, Payload<'b>), Malformed> {
    let tag = take_varint(bytes, pos)?;
    let number = u32::try_from(tag >> 3).ok().filter(|&number| number > 0);
    match (number, Wire::of(tag & 7)) {
        (Some(number), Some(wire)) => Ok((number, take_payload(bytes, pos, wire)?)),
        _ => Err(Malformed::Tag(tag)),
    }
}
