//! What a message says, whatever it was encoded as: one tree of named values.

use std::borrow::Cow;
use std::fmt::{self, Write};

/// How deep messages within messages are read.
pub(crate) const DEPTH: usize = 100;

/// How many values one message may hold, lists of numbers counted as one. A message that unfolds into
/// more, as by sharing its parts, is made to fill memory.
pub(crate) const VALUES: usize = 2 << 20;

/// A message, or its schema, cannot be read.
///
/// ```
/// let error = farside_logs::Unreadable::new("a list that ends too early");
/// assert_eq!(error.to_string(), "a list that ends too early");
/// ```
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what}")]
pub struct Unreadable {
    what: String,
}

impl Unreadable {
    /// An error that says this.
    pub fn new(what: impl Into<String>) -> Self {
        Unreadable { what: what.into() }
    }
}

/// A value of a message. Texts, bytes and lists of numbers are borrowed from the message where they can be.
///
/// ```
/// use farside_logs::Value;
/// let stamp = Value::Object(vec![
///     ("sec".into(), Value::Int(2)),
///     ("nanosec".into(), Value::Int(500_000_000)),
/// ]);
/// let message = Value::Object(vec![("stamp".into(), stamp), ("name".into(), Value::from("r1"))]);
/// assert_eq!(message.at("stamp.sec"), Some(Value::Int(2)));
/// assert_eq!(message.at("stamp").and_then(|stamp| stamp.as_f64()), Some(2.5));
/// assert_eq!(message.to_string(), r#"{"stamp":{"sec":2,"nanosec":500000000},"name":"r1"}"#);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum Value<'a> {
    /// Nothing, in JSON.
    Null,
    /// True or false.
    Bool(bool),
    /// An integer of up to 64 bits, with or without a sign.
    Int(i128),
    /// A number of 64 bits.
    Float(f64),
    /// A number of 32 bits.
    Single(f32),
    /// A number as JSON writes it, with all its digits.
    Decimal(&'a str),
    /// A text.
    Text(Cow<'a, str>),
    /// Bytes, or a text that is not UTF-8.
    Bytes(Cow<'a, [u8]>),
    /// A named number.
    Enum {
        /// The number.
        number: i128,
        /// Its name.
        name: Cow<'a, str>,
    },
    /// Numbers of one kind, as they are in the message.
    Numbers(Numbers<'a>),
    /// Values in order.
    List(Vec<Value<'a>>),
    /// Named values, in the order of the message or of its schema.
    Object(Vec<(Cow<'a, str>, Value<'a>)>),
}

impl<'a> From<&'a str> for Value<'a> {
    fn from(text: &'a str) -> Self {
        Value::Text(Cow::Borrowed(text))
    }
}

/// What the numbers of a list are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names say it")]
pub enum NumberKind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
    Bool,
}

impl NumberKind {
    /// How many bytes one takes.
    pub fn bytes(self) -> usize {
        match self {
            NumberKind::I8 | NumberKind::U8 | NumberKind::Bool => 1,
            NumberKind::I16 | NumberKind::U16 => 2,
            NumberKind::I32 | NumberKind::U32 | NumberKind::F32 => 4,
            NumberKind::I64 | NumberKind::U64 | NumberKind::F64 => 8,
        }
    }

    /// One number from its bytes, the least significant first unless `big`.
    pub(crate) fn read(self, bytes: &[u8], big: bool) -> Value<'static> {
        let mut word = [0; 8];
        let size = self.bytes();
        for (at, byte) in bytes.iter().take(size).enumerate() {
            word[if big { size - 1 - at } else { at }] = *byte;
        }
        let bits = u64::from_le_bytes(word);
        match self {
            NumberKind::I8 => Value::Int((bits as i8).into()),
            NumberKind::I16 => Value::Int((bits as i16).into()),
            NumberKind::I32 => Value::Int((bits as i32).into()),
            NumberKind::I64 => Value::Int((bits as i64).into()),
            NumberKind::U8 | NumberKind::U16 | NumberKind::U32 | NumberKind::U64 => {
                Value::Int(bits.into())
            }
            NumberKind::F32 => Value::Single(f32::from_bits(bits as u32)),
            NumberKind::F64 => Value::Float(f64::from_bits(bits)),
            NumberKind::Bool => Value::Bool(bits != 0),
        }
    }
}

/// Numbers of one kind, still in the bytes of their message.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Numbers<'a> {
    kind: NumberKind,
    big: bool,
    bytes: &'a [u8],
}

impl<'a> Numbers<'a> {
    /// Numbers in these bytes; a rest that is no whole number is left out.
    pub(crate) fn new(kind: NumberKind, big: bool, bytes: &'a [u8]) -> Self {
        Numbers { kind, big, bytes }
    }

    /// What they are.
    pub fn kind(&self) -> NumberKind {
        self.kind
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.bytes.len() / self.kind.bytes()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// One of them.
    pub fn get(&self, at: usize) -> Option<Value<'static>> {
        let size = self.kind.bytes();
        let bytes = self.bytes.get(at.checked_mul(size)?..)?.get(..size)?;
        Some(self.kind.read(bytes, self.big))
    }

    /// One after the other.
    pub fn iter(&self) -> impl Iterator<Item = Value<'static>> + use<'a> {
        let Numbers { kind, big, bytes } = *self;
        let each = bytes.chunks_exact(kind.bytes());
        each.map(move |bytes| kind.read(bytes, big))
    }
}

/// How the two numbers of a time are called: ROS 2, ROS 1, protobuf, and what else is common.
const TIMES: [(&str, &str); 4] = [
    ("sec", "nanosec"),
    ("secs", "nsecs"),
    ("sec", "nsec"),
    ("seconds", "nanos"),
];

/// Whether two fields of these names, in either order, are a time.
pub(crate) fn are_time(one: &str, other: &str) -> bool {
    TIMES.contains(&(one, other)) || TIMES.contains(&(other, one))
}

impl<'a> Value<'a> {
    /// The value of a field of an object.
    pub fn field(&self, name: &str) -> Option<&Value<'a>> {
        match self {
            Value::Object(fields) => {
                let found = fields.iter().find(|(field, _)| field == name);
                found.map(|(_, value)| value)
            }
            _ => None,
        }
    }

    /// The value at a path such as `pose.position.x`, `ranges[3]` or `tracks[0].id`.
    pub fn at(&self, path: &str) -> Option<Value<'a>> {
        let mut value = self;
        let mut number = None;
        for step in path.split('.') {
            let (name, indices) = step.split_at(step.find('[').unwrap_or(step.len()));
            if number.is_some() {
                return None;
            }
            if !name.is_empty() {
                value = value.field(name)?;
            }
            for index in indices.split_terminator(']') {
                let at = index.strip_prefix('[')?.parse::<usize>().ok()?;
                match value {
                    Value::List(values) if number.is_none() => value = values.get(at)?,
                    Value::Numbers(numbers) if number.is_none() => number = Some(numbers.get(at)?),
                    _ => return None,
                }
            }
        }
        Some(number.unwrap_or_else(|| value.clone()))
    }

    /// How many elements a list has; none for what is no list.
    pub fn elements(&self) -> Option<usize> {
        match self {
            Value::List(values) => Some(values.len()),
            Value::Numbers(numbers) => Some(numbers.len()),
            _ => None,
        }
    }

    /// One element of a list.
    pub fn element(&self, at: usize) -> Option<Value<'a>> {
        match self {
            Value::List(values) => values.get(at).cloned(),
            Value::Numbers(numbers) => numbers.get(at),
            _ => None,
        }
    }

    /// The value as a number: what is true is 1, a time is its seconds, an enumeration its number.
    pub fn as_f64(&self) -> Option<f64> {
        match self {
            Value::Bool(value) => Some(f64::from(u8::from(*value))),
            Value::Int(number) | Value::Enum { number, .. } => Some(*number as f64),
            Value::Float(number) => Some(*number),
            Value::Single(number) => Some(f64::from(*number)),
            Value::Decimal(text) => text.parse().ok(),
            Value::Object(_) => self.as_time_ns().map(|ns| ns as f64 / 1e9),
            _ => None,
        }
    }

    /// The value in nanoseconds, if it is a time or a duration: an object of seconds and nanoseconds.
    pub fn as_time_ns(&self) -> Option<i128> {
        let Value::Object(fields) = self else {
            return None;
        };
        let [(one, seconds), (other, nanos)] = fields.as_slice() else {
            return None;
        };
        let is_time = TIMES.contains(&(one.as_ref(), other.as_ref()));
        let whole = |value: &Value<'_>| match value {
            Value::Int(number) => Some(*number),
            Value::Decimal(text) => text.parse::<i64>().ok().map(i128::from),
            _ => None,
        };
        match is_time {
            true => Some(whole(seconds)? * 1_000_000_000 + whole(nanos)?),
            false => None,
        }
    }

    /// Calls `each` with every value that is no object, and its path: lists are one value.
    pub fn flatten(&self, each: &mut impl FnMut(&str, &Value<'a>)) {
        self.flatten_at(&mut String::new(), each);
    }

    fn flatten_at(&self, path: &mut String, each: &mut impl FnMut(&str, &Value<'a>)) {
        let Value::Object(fields) = self else {
            each(path, self);
            return;
        };
        for (name, value) in fields {
            let length = path.len();
            if length > 0 {
                path.push('.');
            }
            path.push_str(name);
            value.flatten_at(path, each);
            path.truncate(length);
        }
    }

    fn write(&self, out: &mut impl Write) -> fmt::Result {
        match self {
            Value::Null => out.write_str("null"),
            Value::Bool(value) => write!(out, "{value}"),
            Value::Int(number) => write!(out, "{number}"),
            Value::Float(number) if number.is_finite() => write!(out, "{number:?}"),
            Value::Float(number) => write_infinite(*number, out),
            Value::Single(number) if number.is_finite() => write!(out, "{number:?}"),
            Value::Single(number) => write_infinite(f64::from(*number), out),
            Value::Decimal(text) => out.write_str(text),
            Value::Text(text) => write_text(text, out),
            Value::Bytes(bytes) => write_base64(bytes, out),
            Value::Enum { name, .. } => write_text(name, out),
            Value::Numbers(numbers) => write_list(numbers.iter(), out),
            Value::List(values) => write_list(values.iter(), out),
            Value::Object(fields) => {
                out.write_char('{')?;
                for (at, (name, value)) in fields.iter().enumerate() {
                    out.write_str(if at == 0 { "" } else { "," })?;
                    write_text(name, out)?;
                    out.write_char(':')?;
                    value.write(out)?;
                }
                out.write_char('}')
            }
        }
    }
}

/// As JSON: enumerations by their names, bytes in base 64, numbers that are infinite or none as texts.
impl fmt::Display for Value<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.write(f)
    }
}

fn write_list<'v, V>(values: impl Iterator<Item = V>, out: &mut impl Write) -> fmt::Result
where
    V: std::borrow::Borrow<Value<'v>>,
{
    out.write_char('[')?;
    for (at, value) in values.enumerate() {
        out.write_str(if at == 0 { "" } else { "," })?;
        value.borrow().write(out)?;
    }
    out.write_char(']')
}

/// What JSON has no number for, as protobuf's JSON writes it.
fn write_infinite(number: f64, out: &mut impl Write) -> fmt::Result {
    out.write_str(match number {
        number if number.is_nan() => "\"NaN\"",
        number if number > 0.0 => "\"Infinity\"",
        _ => "\"-Infinity\"",
    })
}

/// A text in quotes, what has no place in JSON or would move a cursor escaped.
pub(crate) fn write_text(text: &str, out: &mut impl Write) -> fmt::Result {
    out.write_char('"')?;
    for letter in text.chars() {
        match letter {
            '"' => out.write_str("\\\"")?,
            '\\' => out.write_str("\\\\")?,
            '\n' => out.write_str("\\n")?,
            letter if crate::shown::is_hidden(letter) => {
                let mut units = [0; 2];
                for unit in letter.encode_utf16(&mut units) {
                    write!(out, "\\u{unit:04x}")?;
                }
            }
            letter => out.write_char(letter)?,
        }
    }
    out.write_char('"')
}

fn write_base64(bytes: &[u8], out: &mut impl Write) -> fmt::Result {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    out.write_char('"')?;
    for group in bytes.chunks(3) {
        let byte = |at: usize| u32::from(group.get(at).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        for at in 0..4 {
            let letter = LETTERS[(bits >> (18 - 6 * at) & 63) as usize];
            out.write_char(if at > group.len() { '=' } else { letter.into() })?;
        }
    }
    out.write_char('"')
}

/// Calls `each` with every field that a value has; elements of lists are all the same field.
pub(crate) fn names(value: &Value<'_>, each: &mut dyn FnMut(&str)) {
    fn walk(value: &Value<'_>, path: &mut String, each: &mut dyn FnMut(&str)) {
        match value {
            Value::Object(fields) => {
                for (name, value) in fields {
                    within(path, name, &mut |path| {
                        each(path);
                        walk(value, path, each);
                    });
                }
            }
            Value::List(values) => values.iter().for_each(|value| walk(value, path, each)),
            _ => {}
        }
    }
    walk(value, &mut String::new(), each);
}

/// Calls `inner` with a name added to a path.
pub(crate) fn within(path: &mut String, name: &str, inner: &mut dyn FnMut(&mut String)) {
    let length = path.len();
    if length > 0 {
        path.push('.');
    }
    path.push_str(name);
    inner(path);
    path.truncate(length);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_in_base_64() {
        for (bytes, text) in [
            (&b""[..], "\"\""),
            (b"f", "\"Zg==\""),
            (b"fo", "\"Zm8=\""),
            (b"foo", "\"Zm9v\""),
            (b"foob", "\"Zm9vYg==\""),
        ] {
            assert_eq!(Value::Bytes(bytes.into()).to_string(), text);
        }
    }

    #[test]
    fn numbers_are_read_in_either_order() {
        let numbers = Numbers::new(NumberKind::I16, true, &[0xff, 0xfe, 1, 0, 9]);
        assert_eq!(numbers.len(), 2);
        assert_eq!(Value::Numbers(numbers).to_string(), "[-2,256]");
        let bytes = 1.5f32.to_le_bytes();
        let numbers = Numbers::new(NumberKind::F32, false, &bytes);
        assert_eq!(numbers.get(0), Some(Value::Single(1.5)));
        assert_eq!(numbers.get(1), None);
    }

    #[test]
    fn paths_lead_into_lists() {
        let list = Value::Numbers(Numbers::new(NumberKind::U8, false, &[4, 5]));
        let inner = Value::Object(vec![("ranges".into(), list)]);
        let value = Value::Object(vec![("scans".into(), Value::List(vec![inner]))]);
        assert_eq!(value.at("scans[0].ranges[1]"), Some(Value::Int(5)));
        assert_eq!(value.at("scans[1].ranges[1]"), None);
        assert_eq!(value.at("scans[x]"), None);
        assert_eq!(value.at("scan"), None);
    }

    #[test]
    fn what_is_written_is_json() {
        let odd = "a\"\\\u{1}\u{202e}\n\u{e0001}";
        let text = Value::from(odd).to_string();
        assert_eq!(serde_json::from_str::<String>(&text).unwrap(), odd);
        assert!(!text.contains('\u{202e}'));
        let floats = [1e300, -0.0, 0.1, f64::INFINITY, f64::NAN].map(Value::Float);
        let text = Value::List(floats.to_vec()).to_string();
        assert_eq!(text, r#"[1e300,-0.0,0.1,"Infinity","NaN"]"#);
    }
}
