//! CDR, as ROS 2 writes it, and the encoding of ROS 1: values one behind the other, as structs say.
//!
//! CDR begins with four bytes: which kind it is, and its byte order. Each value is aligned to its size,
//! counted from behind these four; in the second version to at most four bytes, and lists of what is no
//! number say how many bytes they have. Kinds whose fields may be left out or carry tags are refused: ROS
//! writes none of them.

use std::borrow::Cow;

use super::structs::{Struct, Structs, Type};
use crate::value::{DEPTH, NumberKind, Numbers, Unreadable, VALUES, Value};

/// Reads a CDR message.
///
/// # Errors
/// If the bytes are not what the schema says.
pub(crate) fn cdr<'a>(structs: &'a Structs, data: &'a [u8]) -> Result<Value<'a>, Unreadable> {
    let short = || Unreadable::new("a message of less than the four bytes that CDR begins with");
    let (head, body) = data.split_first_chunk::<4>().ok_or_else(short)?;
    let (big, second) = match (head[0], head[1]) {
        (0, 0) => (true, false),
        (0, 1) => (false, false),
        (0, 6) => (true, true),
        (0, 7) => (false, true),
        (0, 2 | 3 | 10 | 11) => return Err(refused("parameter lists (mutable types)")),
        (0, 8 | 9) => return Err(refused("delimited types (appendable types)")),
        (high, low) => {
            let what = format!("a message that begins with 0x{high:02x}{low:02x} is no CDR");
            return Err(Unreadable::new(what));
        }
    };
    let most = if second { 4 } else { 8 };
    let read = |wide| {
        let reader = Reader::new(structs, body, (big, most, wide));
        reader.message()
    };
    // Letters of wide texts have four bytes or two: it depends on who wrote them, and the message does not
    // say. The one is right by which the message ends where its bytes end.
    read(4).or_else(|error| match has_wide_text(structs) {
        true => read(2),
        false => Err(error),
    })
}

fn refused(what: &str) -> Unreadable {
    Unreadable::new(format!("CDR with {what} is not read"))
}

/// Reads a message of ROS 1: the same without alignment, in the order of bytes that PCs have.
///
/// # Errors
/// If the bytes are not what the schema says.
pub(crate) fn ros1<'a>(structs: &'a Structs, data: &'a [u8]) -> Result<Value<'a>, Unreadable> {
    Reader::new(structs, data, (false, 1, 4)).message()
}

fn has_wide_text(structs: &Structs) -> bool {
    fn is_wide(kind: &Type) -> bool {
        match kind {
            Type::WideText { .. } => true,
            Type::Array(of, _) | Type::Sequence(of, _) => is_wide(of),
            _ => false,
        }
    }
    let fields = structs.structs.iter().flat_map(|one| &one.fields);
    fields.into_iter().any(|field| is_wide(&field.kind))
}

/// Bytes behind the last field that may be there to fill a word.
const PADDING: usize = 3;

struct Reader<'a> {
    structs: &'a Structs,
    bytes: &'a [u8],
    at: usize,
    big: bool,
    /// The most that a value is aligned to; 1 in ROS 1, 4 in the second version of CDR.
    most_aligned: usize,
    /// How many bytes a letter of a wide text has.
    wide: usize,
    values: usize,
}

impl<'a> Reader<'a> {
    fn new(
        structs: &'a Structs,
        bytes: &'a [u8],
        (big, most_aligned, wide): (bool, usize, usize),
    ) -> Self {
        Reader {
            structs,
            bytes,
            at: 0,
            big,
            most_aligned,
            wide,
            values: 0,
        }
    }

    fn is_ros1(&self) -> bool {
        self.most_aligned == 1
    }

    fn message(mut self) -> Result<Value<'a>, Unreadable> {
        let root = self.structs.get(self.structs.root)?;
        let value = self.fields(root, 0)?;
        let left = self.bytes.len() - self.at.min(self.bytes.len());
        let padding = if self.is_ros1() { 0 } else { PADDING };
        match left > padding {
            true => Err(Unreadable::new(format!(
                "the message has {left} bytes more than its schema says"
            ))),
            false => Ok(value),
        }
    }

    fn count(&mut self, values: usize) -> Result<(), Unreadable> {
        self.values = self.values.saturating_add(values);
        match self.values > VALUES {
            true => Err(Unreadable::new(format!(
                "a message of more than {VALUES} values"
            ))),
            false => Ok(()),
        }
    }

    fn fields(&mut self, of: &'a Struct, depth: usize) -> Result<Value<'a>, Unreadable> {
        if depth > DEPTH {
            return Err(Unreadable::new("messages nested too deep"));
        }
        if let Some(why) = &of.refused {
            return Err(Unreadable::new(why));
        }
        // A struct without fields has one in IDL, as there must be one.
        if of.fields.is_empty() && !self.is_ros1() {
            self.take(1, &of.name)?;
        }
        self.count(1)?;
        let mut fields = Vec::with_capacity(of.fields.len());
        for field in &of.fields {
            let value = self.value(&field.kind, &field.name, depth)?;
            fields.push((Cow::Borrowed(field.name.as_str()), value));
        }
        Ok(Value::Object(fields))
    }

    fn value(&mut self, kind: &'a Type, name: &str, depth: usize) -> Result<Value<'a>, Unreadable> {
        self.count(1)?;
        match kind {
            Type::Number(kind) => {
                let size = kind.bytes();
                self.align(size);
                Ok(kind.read(self.take(size, name)?, self.big))
            }
            Type::Text { .. } => self.text(name),
            Type::WideText { .. } => self.wide_text(name),
            Type::Struct(at) => self.fields(self.structs.get(*at)?, depth + 1),
            Type::Enum(at) => {
                let number = self.u32(name)? as i32;
                let of = self.structs.enums.get(*at);
                let value = of.and_then(|of| of.values.get(&i64::from(number)));
                Ok(match value {
                    None => Value::Int(number.into()),
                    Some(text) => Value::Enum {
                        number: number.into(),
                        name: Cow::Borrowed(text),
                    },
                })
            }
            Type::Array(of, count) => self.list(of, *count as usize, name, depth),
            Type::Sequence(of, most) => {
                if self.most_aligned == 4 && !matches!(**of, Type::Number(_)) {
                    self.u32(name)?;
                }
                let count = self.u32(name)?;
                if let Some(most) = most.filter(|most| count > *most) {
                    let what = format!("{name} has {count} elements, and may have {most}");
                    return Err(Unreadable::new(what));
                }
                self.elements(of, count as usize, name, depth)
            }
        }
    }

    fn list(
        &mut self,
        of: &'a Type,
        count: usize,
        name: &str,
        depth: usize,
    ) -> Result<Value<'a>, Unreadable> {
        if self.most_aligned == 4 && !matches!(of, Type::Number(_)) {
            self.u32(name)?;
        }
        self.elements(of, count, name, depth)
    }

    fn elements(
        &mut self,
        of: &'a Type,
        count: usize,
        name: &str,
        depth: usize,
    ) -> Result<Value<'a>, Unreadable> {
        if let Type::Number(kind) = of {
            // Nothing is aligned for an empty list.
            if count > 0 {
                self.align(kind.bytes());
            }
            let bytes = self.take(count.saturating_mul(kind.bytes()), name)?;
            return Ok(Value::Numbers(Numbers::new(*kind, self.big, bytes)));
        }
        let left = self.bytes.len().saturating_sub(self.at);
        if count > left && !self.is_ros1() {
            return Err(self.too_short(name, count));
        }
        if depth > DEPTH {
            return Err(Unreadable::new("lists nested too deep"));
        }
        self.count(count)?;
        self.values -= count;
        let mut values = Vec::with_capacity(count.min(left));
        for _ in 0..count {
            values.push(self.value(of, name, depth + 1)?);
        }
        Ok(Value::List(values))
    }

    fn too_short(&self, name: &str, wanted: usize) -> Unreadable {
        let left = self.bytes.len().saturating_sub(self.at);
        Unreadable::new(format!(
            "{name} would take {wanted} bytes, but only {left} are left"
        ))
    }

    fn align(&mut self, size: usize) {
        let size = size.min(self.most_aligned).max(1);
        self.at = self.at.next_multiple_of(size);
    }

    fn take(&mut self, count: usize, name: &str) -> Result<&'a [u8], Unreadable> {
        let end = self.at.checked_add(count);
        let taken = end.and_then(|end| self.bytes.get(self.at..end));
        let taken = taken.ok_or_else(|| self.too_short(name, count))?;
        self.at += count;
        Ok(taken)
    }

    fn u32(&mut self, name: &str) -> Result<u32, Unreadable> {
        self.align(4);
        match NumberKind::U32.read(self.take(4, name)?, self.big) {
            Value::Int(number) => Ok(number as u32),
            _ => Ok(0),
        }
    }

    fn text(&mut self, name: &str) -> Result<Value<'a>, Unreadable> {
        let length = self.u32(name)? as usize;
        let bytes = self.take(length, name)?;
        // In CDR a zero ends the text, and counts.
        let bytes = match bytes.split_last() {
            Some((0, text)) if !self.is_ros1() => text,
            _ => bytes,
        };
        Ok(match std::str::from_utf8(bytes) {
            Ok(text) => Value::from(text),
            Err(_) => Value::Bytes(Cow::Borrowed(bytes)),
        })
    }

    fn wide_text(&mut self, name: &str) -> Result<Value<'a>, Unreadable> {
        let length = self.u32(name)? as usize;
        let bytes = self.take(length.saturating_mul(self.wide), name)?;
        let kind = match self.wide {
            2 => NumberKind::U16,
            _ => NumberKind::U32,
        };
        let units = Numbers::new(kind, self.big, bytes).iter();
        let units = units.map(|unit| match unit {
            Value::Int(unit) => u16::try_from(unit).ok(),
            _ => None,
        });
        let units = units.collect::<Option<Vec<u16>>>();
        let text = units.map(|units| String::from_utf16(&units));
        match text {
            Some(Ok(text)) => Ok(Value::Text(Cow::Owned(text))),
            _ => Err(Unreadable::new(format!("{name} is no wide text"))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::rosmsg::{self, Version};
    use super::*;

    fn structs(text: &str) -> Structs {
        rosmsg::read("pkg/Root", text, Version::Two).unwrap()
    }

    fn shown(text: &str, data: &[u8]) -> String {
        let structs = structs(text);
        match cdr(&structs, data) {
            Ok(value) => value.to_string(),
            Err(error) => error.to_string(),
        }
    }

    /// A message that rosbags wrote and mcap_ros2 read, in both orders of bytes: see `tests/foreign`.
    #[test]
    fn what_other_libraries_write_and_read_is_read() {
        let text = include_str!("../../tests/foreign/root.msg");
        let expected = include_str!("../../tests/foreign/root.json").trim();
        assert_eq!(
            shown(text, include_bytes!("../../tests/foreign/root.le.cdr")),
            expected
        );
        assert_eq!(
            shown(text, include_bytes!("../../tests/foreign/root.be.cdr")),
            expected
        );
    }

    #[test]
    fn values_are_aligned_from_behind_the_head() {
        let text = "uint8 a\nfloat64 b\nuint8 c\nuint16 d\nstring e\nuint32 f";
        let body = |little: bool| {
            let order = |bytes: &[u8]| {
                let mut bytes = bytes.to_vec();
                if !little {
                    bytes.reverse();
                }
                bytes
            };
            [
                vec![0, u8::from(little), 0, 0],
                vec![7, 0, 0, 0, 0, 0, 0, 0],
                order(&1.5f64.to_le_bytes()),
                vec![9, 0],
                order(&258u16.to_le_bytes()),
                order(&3u32.to_le_bytes()),
                b"hi\0\0".to_vec(),
                order(&77u32.to_le_bytes()),
            ]
            .concat()
        };
        let expected = r#"{"a":7,"b":1.5,"c":9,"d":258,"e":"hi","f":77}"#;
        assert_eq!(shown(text, &body(true)), expected);
        assert_eq!(shown(text, &body(false)), expected);
    }

    #[test]
    fn the_second_version_aligns_to_four_bytes() {
        let text = "uint32 a\nfloat64 b";
        let data = [&[0, 7, 0, 0, 1, 0, 0, 0][..], &2.5f64.to_le_bytes()].concat();
        assert_eq!(shown(text, &data), r#"{"a":1,"b":2.5}"#);
        let mut first = data.clone();
        first[1] = 1;
        assert!(
            shown(text, &first).contains("only"),
            "{}",
            shown(text, &first)
        );
    }

    #[test]
    fn what_is_not_there_is_not_read() {
        let long = [0, 1, 0, 0, 255, 255, 255, 255];
        for (text, data, word) in [
            ("string a", &[0, 1, 0][..], "four bytes"),
            (
                "string a",
                &[0, 1, 0, 0, 9, 0, 0, 0, 65],
                "a would take 9 bytes, but only 1",
            ),
            (
                "uint8 a",
                &[0, 1, 0, 0, 1, 2, 3, 4, 5],
                "4 bytes more than its schema",
            ),
            ("uint8 a", &[0, 3, 0, 0, 1], "mutable"),
            ("uint8 a", &[0, 9, 0, 0, 1], "appendable"),
            ("uint8 a", &[1, 1, 0, 0, 1], "no CDR"),
            ("float64[] a", &long, "only 0 are left"),
            ("string[] a", &long, "only 0 are left"),
            (
                "uint8[<=2] a",
                &[0, 1, 0, 0, 3, 0, 0, 0, 1, 2, 3],
                "may have 2",
            ),
            ("Root a", &[0, 1, 0, 0, 1], "too deep"),
            ("Root[] a", &long, "only 0 are left"),
        ] {
            let told = shown(text, data);
            assert!(told.contains(word), "{text}: {told}");
        }
    }

    #[test]
    fn a_list_of_empty_structs_takes_no_memory() {
        let text = "E[4000000000] a\n==========\nMSG: pkg/E\n";
        let structs = rosmsg::read("pkg/Root", text, Version::One).unwrap();
        let error = ros1(&structs, &[]).unwrap_err();
        assert!(error.to_string().contains("values"), "{error}");
    }

    #[test]
    fn letters_of_wide_texts_have_four_bytes_or_two() {
        let wide = |bytes: usize| {
            let mut data = vec![0, 1, 0, 0, 3, 0, 0, 0];
            for unit in "a\u{e9}z".encode_utf16() {
                data.extend(&u32::from(unit).to_le_bytes()[..bytes]);
            }
            data.extend([0; 2].iter().filter(|_| bytes == 2));
            data.extend([5, 0, 0, 0]);
            data
        };
        let text = "wstring a\nuint32 b";
        for bytes in [4, 2] {
            assert_eq!(shown(text, &wide(bytes)), "{\"a\":\"aéz\",\"b\":5}");
        }
    }
}
