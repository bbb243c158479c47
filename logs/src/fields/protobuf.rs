//! Two protobuf messages, field by field, each read by its own schema.
//!
//! What is compared is what the messages hold: the work is in proportion to their bytes, whatever
//! their schemas allow. Fields are paired by name; a field that is set and that the other schema
//! does not declare alike differs, also where its bytes are the same.

mod any;
mod held;
mod scalar;
mod value;

use std::collections::BTreeSet;
use std::fmt;
use std::sync::Arc;

use super::{Bound, DEPTH, FieldDiff, Path, Rules, near, raw};
use crate::channel::{ChannelInfo, SchemaInfo};
use crate::schema::{Field, FieldType, MessageType, Types};
use crate::shown::{SHOWN, shorten};
use crate::value::Unreadable;
use crate::wire::{Fields, Value};
use held::{Held, elements, entries, held, merged};
use scalar::{Scalar, WireBits};

/// A message as it is in a file, and how it is to be read.
pub(crate) struct Encoded<'a> {
    bytes: &'a [u8],
    /// Which message of which schema it is; else why that cannot be said.
    read_as: Result<Side<'a>, &'a str>,
    /// The channels of its log.
    others: &'a [Arc<ChannelInfo>],
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
        let others = &[];
        Encoded {
            bytes,
            read_as,
            others,
        }
    }

    /// The same, where also the types that other channels of its log declare are known.
    pub(crate) fn among(self, others: &'a [Arc<ChannelInfo>]) -> Self {
        Encoded { others, ..self }
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
            others: &[],
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
            others: &[],
        }
    }
}

impl<'a> Encoded<'a> {
    /// What the message says, as a value.
    ///
    /// # Errors
    /// If it cannot be read.
    pub(crate) fn value(&self) -> Result<crate::value::Value<'a>, Unreadable> {
        let side = self.read_as.map_err(Unreadable::new)?;
        value::message(self.bytes, side, self.others)
    }

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
    rules: &Rules,
) -> Option<FieldDiff> {
    let field = || if prefix.is_empty() { "data" } else { prefix };
    match (&a.read_as, &b.read_as) {
        (Ok(x), Ok(y)) => {
            let bound = rules.enter_root(prefix)?;
            let within = Within { bound, depth: 0 };
            let others = [a.others, b.others];
            let comparison = Comparison { rules, others };
            comparison.messages(&Path::Root(prefix), (a.bytes, *x), (b.bytes, *y), within)
        }
        _ if a.bytes == b.bytes => None,
        (Err(why), _) | (_, Err(why)) => {
            Some(raw(field(), a.bytes, b.bytes).because(why.to_string()))
        }
    }
}

/// What a message says, of the type that its schema is for.
///
/// # Errors
/// If the schema or the message cannot be read.
pub(crate) fn protobuf_value<'a>(
    bytes: &'a [u8],
    schema: &'a SchemaInfo,
    others: &'a [Arc<ChannelInfo>],
) -> Result<crate::value::Value<'a>, Unreadable> {
    let types = schema.types().map_err(Unreadable::new)?;
    value::message(bytes, side(types, Some(types.root())), others)
}

struct Comparison<'r> {
    rules: &'r Rules,
    /// What else each log declares: what is packed in an `Any` may be of any of its types.
    others: [&'r [Arc<ChannelInfo>]; 2],
}

/// Where in a message a part is, and what holds there.
#[derive(Clone, Copy)]
struct Within {
    bound: Bound,
    depth: usize,
}

impl Within {
    fn deeper(self) -> Within {
        Within {
            depth: self.depth + 1,
            ..self
        }
    }
}

/// One side of a field: how it is declared, what the message holds of it, and the schema.
#[derive(Clone, Copy)]
struct Half<'a> {
    field: &'a Field,
    values: &'a [Value<'a>],
    types: &'a Types,
}

impl Comparison<'_> {
    fn messages(
        &self,
        path: &Path<'_>,
        a: (&[u8], Side<'_>),
        b: (&[u8], Side<'_>),
        within: Within,
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
        if within.depth > DEPTH {
            return by_bytes("messages nested too deep");
        }
        let (one, other) = (a.1.types.message(one), b.1.types.message(other));
        let inner_a = any::packed(a.0, one, (a.1.types, self.others[0]));
        let inner_b = any::packed(b.0, other, (b.1.types, self.others[1]));
        if let (Some(x), Some(y)) = (&inner_a, &inner_b)
            && x.url == y.url
        {
            let within = within.deeper();
            return self.messages(path, (&x.bytes, x.side), (&y.bytes, y.side), within);
        }
        let (Some(x), Some(y)) = (held(a.0, one), held(b.0, other)) else {
            return by_bytes("bytes that are no protobuf message");
        };
        let named = |number: &u32| Some(one.named(&other.fields.get(number)?.name)?.number);
        let known = |number: &&u32| one.fields.contains_key(number);
        let numbers = x.keys().filter(known).copied();
        let numbers: BTreeSet<u32> = numbers.chain(y.keys().filter_map(named)).collect();
        for field in numbers.iter().filter_map(|number| one.fields.get(number)) {
            let path = Path::Field(path, &field.name);
            let Some(bound) = self.rules.enter(&path, within.bound) else {
                continue;
            };
            let within = Within { bound, ..within };
            let half_a = Half::of(field, &x, a.1.types);
            let found = match other.named(&field.name) {
                Some(field) => {
                    let half_b = Half::of(field, &y, b.1.types);
                    self.fields(&path, half_a, half_b, within)
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
        self.only_in_b(path, one, (other, &y), b.1.types)
            .or_else(|| unknown(path, (&x, one), (&y, other)))
    }

    fn fields(
        &self,
        path: &Path<'_>,
        a: Half<'_>,
        b: Half<'_>,
        within: Within,
    ) -> Option<FieldDiff> {
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
            (Some(x), Some(y)) => return self.maps(path, (a, x), (b, y), within),
            _ if a.field.repeated => return self.lists(path, a, b, within),
            _ => {}
        }
        // Where absent is something else than zero.
        if a.field.presence && a.values.is_empty() != b.values.is_empty() {
            return Some(FieldDiff::new(path.to_string(), a.show(), b.show()));
        }
        if let (FieldType::Message(one), FieldType::Message(other)) = (a.field.kind, b.field.kind) {
            let (x, y) = (merged(a.values), merged(b.values));
            let (a, b) = ((&*x, side(a.types, one)), (&*y, side(b.types, other)));
            return match self.times_agree(a, b, within.bound) {
                true => None,
                false => self.messages(path, a, b, within.deeper()),
            };
        }
        let last = (a.values.last().copied(), b.values.last().copied());
        self.scalars(path, a.field.kind, last, within.bound)
    }

    fn scalars(
        &self,
        path: &dyn fmt::Display,
        kind: FieldType,
        (a, b): (Option<Value<'_>>, Option<Value<'_>>),
        bound: Bound,
    ) -> Option<FieldDiff> {
        let (a, b) = (Scalar::read(kind, a), Scalar::read(kind, b));
        let same = match (&a, &b) {
            (Scalar::Double(x), Scalar::Double(y)) => near(*x, *y, bound.number),
            (Scalar::Float(x), Scalar::Float(y)) => {
                near(f64::from(*x), f64::from(*y), bound.number)
            }
            (Scalar::Int(x), Scalar::Int(y)) => {
                x == y || bound.own && near(*x as f64, *y as f64, bound.number)
            }
            (a, b) => a == b,
        };
        (!same).then(|| a.differs(path, &b))
    }

    fn lists(
        &self,
        path: &Path<'_>,
        a: Half<'_>,
        b: Half<'_>,
        within: Within,
    ) -> Option<FieldDiff> {
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
                    self.messages(&path, (x, one), (y, other), within.deeper())
                }
                // Most elements are the same.
                _ if x == y => None,
                (kind, _) => self.scalars(&path, kind, (Some(*x), Some(*y)), within.bound),
            };
            if found.is_some() {
                return found;
            }
        }
        let differ = x.len() != y.len();
        differ.then(|| FieldDiff::new(format!("{path}.length"), x.len(), y.len()))
    }

    /// Fields that are set in the second message and that only its schema declares.
    fn only_in_b(
        &self,
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
            self.rules.enter(&path, self.rules.bound())?;
            Some(FieldDiff::new(
                path.to_string(),
                "no such field",
                half.show(),
            ))
        })
    }

    /// Whether two messages are times that agree within what their field allows.
    fn times_agree(&self, a: (&[u8], Side<'_>), b: (&[u8], Side<'_>), bound: Bound) -> bool {
        let time = |(bytes, side)| value::message(bytes, side, &[]).ok()?.as_time_ns();
        bound.time_ns > 0
            && matches!((time(a), time(b)), (Some(x), Some(y)) if self.rules.times_agree(x, y, bound))
    }

    fn maps(
        &self,
        path: &Path<'_>,
        (a, entry_a): (Half<'_>, &MessageType),
        (b, entry_b): (Half<'_>, &MessageType),
        within: Within,
    ) -> Option<FieldDiff> {
        let (x, y) = (entries(a.values, entry_a), entries(b.values, entry_b));
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
                    self.fields(&path, one, half(other, y, b.types), within.deeper())
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
        elements(self.field.kind, self.values)
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

#[cfg(test)]
mod tests;
