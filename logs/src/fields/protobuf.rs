//! Two protobuf messages, field by field, each read by its own schema.
//!
//! What is compared is what the messages hold: the work is in proportion to their bytes, whatever
//! their schemas allow. Fields are paired by name; a field that is set and that the other schema
//! does not declare alike differs, also where its bytes are the same.

mod scalar;

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use prost_types::field_descriptor_proto::Type;

use super::{DEPTH, FieldDiff, Path, near, raw};
use crate::scan::SchemaInfo;
use crate::schema::{Field, FieldType, MessageType, Types};
use crate::shown::{SHOWN, shorten};
use crate::wire::{Fields, Value};
use scalar::{Scalar, WireBits};

/// A message as it is in a file, and how it is to be read.
pub(crate) struct Encoded<'a> {
    bytes: &'a [u8],
    /// Which message of which schema it is; else why that cannot be said.
    read_as: Result<Side<'a>, &'a str>,
}

/// A message type of a schema; `None` for one that the schema does not declare.
#[derive(Clone, Copy)]
struct Side<'a> {
    types: &'a Types,
    message: Option<usize>,
}

const NO_SCHEMA: &str = "the channel has no schema";

impl<'a> Encoded<'a> {
    /// A message of the type that the schema is for.
    pub(crate) fn new(bytes: &'a [u8], schema: Option<&'a SchemaInfo>) -> Self {
        let types = schema.ok_or(NO_SCHEMA).and_then(SchemaInfo::types);
        let message = |types: &Types| Some(types.root());
        let read_as = types.map(|types| Side {
            types,
            message: message(types),
        });
        Encoded { bytes, read_as }
    }

    /// The body of an envelope: a message of the type of the schema's field `body`.
    pub(crate) fn body(bytes: &'a [u8], schema: Option<&'a SchemaInfo>) -> Self {
        let Encoded { read_as, .. } = Encoded::new(bytes, schema);
        let body = |side: Side<'a>| {
            let envelope = side.types.message(side.types.root());
            match envelope.named("body").map(|field| field.kind) {
                Some(FieldType::Message(message)) => Ok(Side { message, ..side }),
                _ => Err("the envelope's schema declares no body"),
            }
        };
        Encoded {
            bytes,
            read_as: read_as.and_then(body),
        }
    }

    /// A message of the type that `types` are for.
    pub(crate) fn of(bytes: &'a [u8], types: &'a Result<Types, String>) -> Self {
        let side = |types: &'a Types| Side {
            types,
            message: Some(types.root()),
        };
        Encoded {
            bytes,
            read_as: types.as_ref().map(side).map_err(String::as_str),
        }
    }
}

impl Encoded<'_> {
    /// What the message holds, in a few words; none where it cannot be read.
    pub(crate) fn shown(&self) -> Option<String> {
        let side = self.read_as.as_ref().ok()?;
        let mut text = String::new();
        show_message(self.bytes, *side, &mut text, 0);
        Some(shorten(&text))
    }
}

/// The first field in which two messages differ; `None` if none differs by more than the
/// tolerance. Where they cannot be read, the first byte, and why.
pub(crate) fn protobuf(
    prefix: &str,
    a: &Encoded<'_>,
    b: &Encoded<'_>,
    tolerance: f64,
) -> Option<FieldDiff> {
    let field = || if prefix.is_empty() { "data" } else { prefix };
    match (&a.read_as, &b.read_as) {
        (Ok(x), Ok(y)) => {
            let comparison = Comparison { tolerance };
            comparison.messages(&Path::Root(prefix), (a.bytes, *x), (b.bytes, *y), 0)
        }
        _ if a.bytes == b.bytes => None,
        (Err(why), _) | (_, Err(why)) => {
            Some(raw(field(), a.bytes, b.bytes).because(why.to_string()))
        }
    }
}

/// What a message holds, by field number.
type Held<'a> = BTreeMap<u32, Vec<Value<'a>>>;

/// Takes a message apart. Of a oneof, only what was set last is held.
fn held<'a>(bytes: &'a [u8], of: &MessageType) -> Option<Held<'a>> {
    let mut held: Held<'a> = BTreeMap::new();
    let mut set: BTreeMap<i32, u32> = BTreeMap::new();
    for field in Fields::new(bytes) {
        let (number, value) = field.ok()?;
        if let Some(oneof) = of.fields.get(&number).and_then(|field| field.oneof)
            && let Some(before) = set.insert(oneof, number)
            && before != number
        {
            held.remove(&before);
        }
        held.entry(number).or_default().push(value);
    }
    Some(held)
}

struct Comparison {
    tolerance: f64,
}

/// One side of a field: how it is declared, what the message holds of it, and the schema.
#[derive(Clone, Copy)]
struct Half<'a> {
    field: &'a Field,
    values: &'a [Value<'a>],
    types: &'a Types,
}

impl Comparison {
    fn messages(
        &self,
        path: &Path<'_>,
        a: (&[u8], Side<'_>),
        b: (&[u8], Side<'_>),
        depth: usize,
    ) -> Option<FieldDiff> {
        let same_schema = std::ptr::eq(a.1.types, b.1.types);
        if same_schema && a.0 == b.0 {
            return None;
        }
        let by_bytes = |why: &str| {
            let name = path.to_string();
            let name = if name.is_empty() {
                "data".to_owned()
            } else {
                name
            };
            (a.0 != b.0).then(|| raw(name, a.0, b.0).because(why))
        };
        let (Some(one), Some(other)) = (a.1.message, b.1.message) else {
            return by_bytes("a type that the schema does not declare");
        };
        if depth > DEPTH {
            return by_bytes("messages nested too deep");
        }
        let (one, other) = (a.1.types.message(one), b.1.types.message(other));
        let (Some(x), Some(y)) = (held(a.0, one), held(b.0, other)) else {
            return by_bytes("bytes that are no protobuf message");
        };
        let named = |number: &u32| Some(one.named(&other.fields.get(number)?.name)?.number);
        let known = |number: &&u32| one.fields.contains_key(number);
        let numbers = x.keys().filter(known).copied();
        let numbers: BTreeSet<u32> = numbers.chain(y.keys().filter_map(named)).collect();
        for field in numbers.iter().filter_map(|number| one.fields.get(number)) {
            let path = Path::Field(path, &field.name);
            let half_a = Half::of(field, &x, a.1.types);
            let found = match other.named(&field.name) {
                Some(field) => {
                    let half_b = Half::of(field, &y, b.1.types);
                    self.fields(&path, half_a, half_b, depth)
                }
                None if !half_a.is_set() => None,
                None => {
                    let text = half_a.show();
                    Some(FieldDiff::new(path.to_string(), text, "no such field"))
                }
            };
            if found.is_some() {
                return found;
            }
        }
        only_in_b(path, one, (other, &y), b.1.types)
            .or_else(|| unknown(path, (&x, one), (&y, other)))
    }

    fn fields(&self, path: &Path<'_>, a: Half<'_>, b: Half<'_>, depth: usize) -> Option<FieldDiff> {
        if !a.is_set() && !b.is_set() {
            return None;
        }
        if !a.field.kind.is_like(b.field.kind) || a.field.repeated != b.field.repeated {
            let text = |half: Half<'_>| {
                let repeated = if half.field.repeated { "repeated " } else { "" };
                format!("{} ({repeated}{})", half.show(), half.field.kind.name())
            };
            return Some(FieldDiff::new(path.to_string(), text(a), text(b)));
        }
        let scalar = matches!(a.field.kind, FieldType::Scalar(_));
        if a.values == b.values && (scalar || std::ptr::eq(a.types, b.types)) {
            return None;
        }
        match (a.map_entry(), b.map_entry()) {
            (Some(x), Some(y)) => return self.maps(path, (a, x), (b, y), depth),
            _ if a.field.repeated => return self.lists(path, a, b, depth),
            _ => {}
        }
        // Where absent is something else than zero.
        if a.field.presence && a.values.is_empty() != b.values.is_empty() {
            return Some(FieldDiff::new(path.to_string(), a.show(), b.show()));
        }
        if let (FieldType::Message(one), FieldType::Message(other)) = (a.field.kind, b.field.kind) {
            let (x, y) = (merged(a.values), merged(b.values));
            let a = side(a.types, one);
            let b = side(b.types, other);
            return self.messages(path, (&x, a), (&y, b), depth + 1);
        }
        let last = (a.values.last().copied(), b.values.last().copied());
        self.scalars(path, a.field.kind, last)
    }

    fn scalars(
        &self,
        path: &dyn fmt::Display,
        kind: FieldType,
        (a, b): (Option<Value<'_>>, Option<Value<'_>>),
    ) -> Option<FieldDiff> {
        let (a, b) = (Scalar::read(kind, a), Scalar::read(kind, b));
        let same = match (&a, &b) {
            (Scalar::Double(x), Scalar::Double(y)) => near(*x, *y, self.tolerance),
            (Scalar::Float(x), Scalar::Float(y)) => {
                near(f64::from(*x), f64::from(*y), self.tolerance)
            }
            (a, b) => a == b,
        };
        (!same).then(|| a.differs(path, &b))
    }

    fn lists(&self, path: &Path<'_>, a: Half<'_>, b: Half<'_>, depth: usize) -> Option<FieldDiff> {
        let (x, y) = (a.elements(), b.elements());
        let (Some(x), Some(y)) = (x, y) else {
            let (x, y) = (merged(a.values), merged(b.values));
            let why = "a list that is malformed";
            return (x != y).then(|| raw(path.to_string(), &x, &y).because(why));
        };
        for (at, (x, y)) in x.iter().zip(&y).enumerate() {
            let path = Path::Entry(path, &at);
            let found = match (a.field.kind, b.field.kind) {
                (FieldType::Message(one), FieldType::Message(other)) => {
                    let (x, y) = (content(x), content(y));
                    let (one, other) = (side(a.types, one), side(b.types, other));
                    self.messages(&path, (x, one), (y, other), depth + 1)
                }
                // Most elements are the same.
                _ if x == y => None,
                (kind, _) => self.scalars(&path, kind, (Some(*x), Some(*y))),
            };
            if found.is_some() {
                return found;
            }
        }
        let differ = x.len() != y.len();
        differ.then(|| FieldDiff::new(format!("{path}.length"), x.len(), y.len()))
    }

    fn maps(
        &self,
        path: &Path<'_>,
        (a, entry_a): (Half<'_>, &MessageType),
        (b, entry_b): (Half<'_>, &MessageType),
        depth: usize,
    ) -> Option<FieldDiff> {
        let (x, y) = (entries(a, entry_a), entries(b, entry_b));
        let (Some(x), Some(y)) = (x, y) else {
            let (x, y) = (merged(a.values), merged(b.values));
            let why = "a map that is malformed";
            return (x != y).then(|| raw(path.to_string(), &x, &y).because(why));
        };
        let keys: BTreeSet<&String> = x.keys().chain(y.keys()).collect();
        for key in keys {
            let path = Path::Entry(path, key);
            let found = match (x.get(key), y.get(key)) {
                (Some(x), Some(y)) => {
                    let of = |entry| MessageType::value_of_entry(entry);
                    let (Some(one), Some(other)) = (of(entry_a), of(entry_b)) else {
                        continue;
                    };
                    let half = |field, values, types| Half {
                        field,
                        values,
                        types,
                    };
                    let one = half(one, x, a.types);
                    self.fields(&path, one, half(other, y, b.types), depth + 1)
                }
                (x, _) => {
                    let word = |has: bool| if has { "present" } else { "absent" };
                    let (a, b) = (word(x.is_some()), word(x.is_none()));
                    Some(FieldDiff::new(path.to_string(), a, b))
                }
            };
            if found.is_some() {
                return found;
            }
        }
        None
    }
}

/// Fields that are set in the second message and that only its schema declares.
fn only_in_b(
    path: &Path<'_>,
    one: &MessageType,
    (other, held): (&MessageType, &Held<'_>),
    types: &Types,
) -> Option<FieldDiff> {
    held.iter().find_map(|(number, values)| {
        let field = other.fields.get(number)?;
        let half = Half {
            field,
            values,
            types,
        };
        if one.named(&field.name).is_some() || !half.is_set() {
            return None;
        }
        let path = Path::Field(path, &field.name);
        Some(FieldDiff::new(
            path.to_string(),
            "no such field",
            half.show(),
        ))
    })
}

/// Fields that neither schema declares.
fn unknown(
    path: &Path<'_>,
    (x, one): (&Held<'_>, &MessageType),
    (y, other): (&Held<'_>, &MessageType),
) -> Option<FieldDiff> {
    let numbers: BTreeSet<&u32> = x.keys().chain(y.keys()).collect();
    let strange =
        |number: &&u32| !one.fields.contains_key(number) && !other.fields.contains_key(number);
    numbers.into_iter().filter(strange).find_map(|number| {
        let (a, b) = (x.get(number), y.get(number));
        if a == b {
            return None;
        }
        let name = format!("unknown field {number}");
        let path = Path::Field(path, &name).to_string();
        let values = |held: Option<&'_ Vec<_>>| held.map_or(0, Vec::len);
        let (n, m) = (values(a), values(b));
        let same =
            |at: &usize| a.and_then(|held| held.get(*at)) == b.and_then(|held| held.get(*at));
        let first = (0..n.max(m)).find(|at| !same(at))?;
        let path = match (n.max(m), n == m) {
            (1, _) => path,
            (_, true) => format!("{path}[{first}]"),
            (_, false) => return Some(FieldDiff::new(format!("{path}.length"), n, m)),
        };
        let [a, b] = [a, b].map(|values| match values.and_then(|values| values.get(first)) {
            Some(value) => Scalar::Wire(WireBits(*value)),
            None => Scalar::Absent,
        });
        Some(a.differs(&path, &b))
    })
}

fn side(types: &Types, message: Option<usize>) -> Side<'_> {
    Side { types, message }
}

/// The bytes of a message field; none of anything else.
fn content<'a>(value: &Value<'a>) -> &'a [u8] {
    match value {
        Value::Bytes(bytes) | Value::Group(bytes) => bytes,
        _ => &[],
    }
}

/// A message that is there several times is one: its parts one behind the other.
fn merged<'a>(values: &[Value<'a>]) -> Cow<'a, [u8]> {
    match values {
        [] => Cow::Borrowed(&[]),
        [value] => Cow::Borrowed(content(value)),
        values => Cow::Owned(values.iter().flat_map(content).copied().collect()),
    }
}

/// The entries of a map, by key as shown: the values of each.
fn entries<'a>(half: Half<'a>, entry: &MessageType) -> Option<BTreeMap<String, Vec<Value<'a>>>> {
    let kind = entry.fields.get(&1).map(|field| field.kind);
    let mut entries = BTreeMap::new();
    for value in half.values {
        let mut held = held(content(value), entry)?;
        let key = held.remove(&1).and_then(|keys| keys.last().copied());
        let kind = kind.unwrap_or(FieldType::Scalar(Type::Bytes));
        let key = Scalar::read(kind, key).whole();
        entries.insert(key, held.remove(&2).unwrap_or_default());
    }
    Some(entries)
}

impl<'a> Half<'a> {
    fn of(field: &'a Field, held: &'a Held<'a>, types: &'a Types) -> Half<'a> {
        Half {
            field,
            values: held.get(&field.number).map_or(&[], Vec::as_slice),
            types,
        }
    }

    /// The message holds something there that is not the same as nothing.
    fn is_set(&self) -> bool {
        if self.field.presence || self.field.repeated {
            return !self.values.is_empty();
        }
        let zero = Scalar::read(self.field.kind, None);
        let last = self.values.last();
        last.is_some_and(|last| Scalar::read(self.field.kind, Some(*last)) != zero)
    }

    fn map_entry(&self) -> Option<&'a MessageType> {
        let FieldType::Message(Some(at)) = self.field.kind else {
            return None;
        };
        Some(self.types.message(at)).filter(|message| message.map_entry && self.field.repeated)
    }

    /// The elements of a list, packed or not.
    fn elements(&self) -> Option<Vec<Value<'a>>> {
        let FieldType::Scalar(kind) = self.field.kind else {
            return Some(self.values.to_vec());
        };
        if matches!(kind, Type::String | Type::Bytes) {
            return Some(self.values.to_vec());
        }
        let mut elements = Vec::new();
        for value in self.values {
            match value {
                Value::Bytes(packed) => unpack(kind, packed, &mut elements)?,
                value => elements.push(*value),
            }
        }
        Some(elements)
    }

    /// What is there, in a few words.
    fn show(&self) -> String {
        match (self.field.kind, self.values) {
            (_, []) => "absent".to_owned(),
            (_, _) if self.field.repeated => match self.elements() {
                Some(elements) => format!("{} values", elements.len()),
                None => "a list that is malformed".to_owned(),
            },
            (FieldType::Message(message), values) => {
                let mut text = String::new();
                let bytes = merged(values);
                show_message(&bytes, side(self.types, message), &mut text, 0);
                shorten(&text)
            }
            (kind, values) => Scalar::read(kind, values.last().copied()).show(),
        }
    }
}

/// Appends the fields of a message, until there is enough to be shown.
fn show_message(bytes: &[u8], side: Side<'_>, out: &mut String, depth: usize) {
    out.push('{');
    let of = side.message.map(|at| side.types.message(at));
    let mut first = true;
    for field in Fields::new(bytes) {
        if out.len() > SHOWN || depth > 10 {
            break;
        }
        let Ok((number, value)) = field else { break };
        if !first {
            out.push_str(", ");
        }
        first = false;
        match of.and_then(|of| of.fields.get(&number)) {
            None => out.push_str(&format!(
                "{number}: {}",
                Scalar::Wire(WireBits(value)).show()
            )),
            Some(field) => {
                out.push_str(&field.name);
                out.push_str(": ");
                match field.kind {
                    FieldType::Message(message) => {
                        let inner = self::side(side.types, message);
                        show_message(content(&value), inner, out, depth + 1);
                    }
                    kind => out.push_str(&Scalar::read(kind, Some(value)).show()),
                }
            }
        }
    }
    out.push('}');
}

fn unpack<'a>(kind: Type, mut packed: &'a [u8], out: &mut Vec<Value<'a>>) -> Option<()> {
    while !packed.is_empty() {
        let value = match kind {
            Type::Double | Type::Fixed64 | Type::Sfixed64 => {
                let (bytes, rest) = packed.split_first_chunk::<8>()?;
                packed = rest;
                Value::Fixed64(u64::from_le_bytes(*bytes))
            }
            Type::Float | Type::Fixed32 | Type::Sfixed32 => {
                let (bytes, rest) = packed.split_first_chunk::<4>()?;
                packed = rest;
                Value::Fixed32(u32::from_le_bytes(*bytes))
            }
            _ => {
                let mut fields = Fields::new(packed);
                let value = fields.varint()?;
                packed = fields.rest();
                Value::Varint(value)
            }
        };
        out.push(value);
    }
    Some(())
}

#[cfg(test)]
mod tests;
