//! Comparing two messages field by field, and naming the first field that differs.

use prost_reflect::{DynamicMessage, Kind, MapKey, MessageDescriptor, ReflectMessage, Value};

use crate::envelope::RecordRef;
use crate::envelope::seconds;
use crate::scan::ChannelInfo;

/// The first field in which two things differ, with both values.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FieldDiff {
    pub(crate) field: String,
    pub(crate) a: String,
    pub(crate) b: String,
}

impl FieldDiff {
    pub(crate) fn new(field: impl Into<String>, a: impl ToString, b: impl ToString) -> Self {
        FieldDiff {
            field: field.into(),
            a: a.to_string(),
            b: b.to_string(),
        }
    }
}

/// The descriptor of what is in the `body` of a channel's envelopes.
pub(crate) fn body_descriptor(channel: &ChannelInfo) -> Option<MessageDescriptor> {
    let envelope = channel.schema.as_ref()?.descriptor()?;
    match envelope.get_field_by_name("body")?.kind() {
        Kind::Message(body) => Some(body),
        _ => None,
    }
}

/// The first field in which two encoded messages differ; `None` if none differs by more than the
/// tolerance.
pub(crate) fn bodies(
    prefix: &str,
    a: (&[u8], Option<&MessageDescriptor>),
    b: (&[u8], Option<&MessageDescriptor>),
    tolerance: f64,
) -> Option<FieldDiff> {
    if a.0 == b.0 {
        return None;
    }
    let decode = |(bytes, descriptor): (&[u8], Option<&MessageDescriptor>)| {
        DynamicMessage::decode(descriptor?.clone(), bytes).ok()
    };
    match (decode(a), decode(b)) {
        (Some(x), Some(y)) => messages(prefix, &x, &y, tolerance),
        // Without a descriptor the bytes are all there is.
        _ => Some(raw(prefix, a.0, b.0)),
    }
}

/// The first byte in which two messages differ.
pub(crate) fn raw(prefix: &str, a: &[u8], b: &[u8]) -> FieldDiff {
    let at = a.iter().zip(b).position(|(x, y)| x != y);
    let at = at.unwrap_or(a.len().min(b.len()));
    let show = |bytes: &[u8]| {
        let shown: String = bytes
            .iter()
            .skip(at)
            .take(16)
            .map(|b| format!("{b:02x}"))
            .collect();
        format!("{} bytes, from byte {at}: {shown}", bytes.len())
    };
    FieldDiff::new(prefix, show(a), show(b))
}

fn messages(
    prefix: &str,
    a: &DynamicMessage,
    b: &DynamicMessage,
    tolerance: f64,
) -> Option<FieldDiff> {
    let path = |name: &str| match prefix {
        "" => name.to_owned(),
        prefix => format!("{prefix}.{name}"),
    };
    for field in a.descriptor().fields() {
        let name = field.name();
        let Some(other) = b.descriptor().get_field_by_name(name) else {
            return Some(FieldDiff::new(
                path(name),
                show(&a.get_field(&field)),
                "no such field",
            ));
        };
        let (has_a, has_b) = (a.has_field(&field), b.has_field(&other));
        if field.supports_presence() && has_a != has_b {
            let text = |has: bool, value: &Value| {
                if has {
                    show(value)
                } else {
                    "absent".to_owned()
                }
            };
            let (x, y) = (a.get_field(&field), b.get_field(&other));
            return Some(FieldDiff::new(path(name), text(has_a, &x), text(has_b, &y)));
        }
        let (x, y) = (a.get_field(&field), b.get_field(&other));
        if let Some(found) = values(&path(name), &x, &y, tolerance) {
            return Some(found);
        }
    }
    let added = b.descriptor().fields().find(|field| {
        b.has_field(field) && a.descriptor().get_field_by_name(field.name()).is_none()
    });
    added.map(|field| {
        FieldDiff::new(
            path(field.name()),
            "no such field",
            show(&b.get_field(&field)),
        )
    })
}

fn values(path: &str, a: &Value, b: &Value, tolerance: f64) -> Option<FieldDiff> {
    let same = match (a, b) {
        (Value::F64(x), Value::F64(y)) => near(*x, *y, tolerance),
        (Value::F32(x), Value::F32(y)) => near(f64::from(*x), f64::from(*y), tolerance),
        (Value::Message(x), Value::Message(y)) => return messages(path, x, y, tolerance),
        (Value::List(x), Value::List(y)) => {
            let mut pairs = x.iter().zip(y).enumerate();
            let found =
                pairs.find_map(|(at, (x, y))| values(&format!("{path}[{at}]"), x, y, tolerance));
            if found.is_some() {
                return found;
            }
            if x.len() != y.len() {
                return Some(FieldDiff::new(format!("{path}.length"), x.len(), y.len()));
            }
            true
        }
        (Value::Map(x), Value::Map(y)) => {
            // Sorted, so that the first difference is the same one each time.
            let mut keys: Vec<_> = x.keys().chain(y.keys()).collect();
            keys.sort_by_key(|key| map_key(key));
            keys.dedup();
            return keys.into_iter().find_map(|key| {
                let path = format!("{path}[{}]", map_key(key));
                match (x.get(key), y.get(key)) {
                    (Some(x), Some(y)) => values(&path, x, y, tolerance),
                    (x, y) => {
                        let text = |value: Option<&Value>| value.map_or("absent".to_owned(), show);
                        Some(FieldDiff::new(path, text(x), text(y)))
                    }
                }
            });
        }
        (a, b) => a == b,
    };
    (!same).then(|| FieldDiff::new(path, show(a), show(b)))
}

/// True if two numbers differ by at most the tolerance, absolutely or relative to the larger one.
pub(crate) fn near(a: f64, b: f64, tolerance: f64) -> bool {
    if a == b || (a.is_nan() && b.is_nan()) {
        return true;
    }
    let apart = (a - b).abs();
    tolerance > 0.0 && (apart <= tolerance || apart <= tolerance * a.abs().max(b.abs()))
}

fn map_key(key: &MapKey) -> String {
    match key {
        MapKey::Bool(key) => key.to_string(),
        MapKey::I32(key) => key.to_string(),
        MapKey::I64(key) => key.to_string(),
        MapKey::U32(key) => key.to_string(),
        MapKey::U64(key) => key.to_string(),
        MapKey::String(key) => key.clone(),
    }
}

/// The first place in which two JSON documents differ.
pub(crate) fn json(a: &[u8], b: &[u8], tolerance: f64) -> Option<FieldDiff> {
    if a == b {
        return None;
    }
    let parse = |bytes| serde_json::from_slice::<serde_json::Value>(bytes).ok();
    match (parse(a), parse(b)) {
        (Some(x), Some(y)) => json_values("data", &x, &y, tolerance),
        _ => Some(raw("data", a, b)),
    }
}

fn json_values(
    path: &str,
    a: &serde_json::Value,
    b: &serde_json::Value,
    tolerance: f64,
) -> Option<FieldDiff> {
    use serde_json::Value;
    let same = match (a, b) {
        (Value::Number(x), Value::Number(y)) => match (x.as_f64(), y.as_f64()) {
            (Some(x), Some(y)) if tolerance > 0.0 => near(x, y, tolerance),
            _ => x == y,
        },
        (Value::Array(x), Value::Array(y)) if x.len() == y.len() => {
            let mut pairs = x.iter().zip(y).enumerate();
            return pairs
                .find_map(|(at, (x, y))| json_values(&format!("{path}[{at}]"), x, y, tolerance));
        }
        (Value::Object(x), Value::Object(y)) => {
            let mut keys: Vec<_> = x.keys().chain(y.keys()).collect();
            keys.sort();
            keys.dedup();
            return keys.into_iter().find_map(|key| {
                let absent = Value::Null;
                let (x, y) = (x.get(key).unwrap_or(&absent), y.get(key).unwrap_or(&absent));
                json_values(&format!("{path}.{key}"), x, y, tolerance)
            });
        }
        (a, b) => a == b,
    };
    (!same).then(|| FieldDiff::new(path, shorten(a.to_string()), shorten(b.to_string())))
}

/// A value in a few words.
fn show(value: &Value) -> String {
    let text = match value {
        Value::Bool(value) => value.to_string(),
        Value::I32(value) => value.to_string(),
        Value::I64(value) => value.to_string(),
        Value::U32(value) => value.to_string(),
        Value::U64(value) => value.to_string(),
        Value::F32(value) => value.to_string(),
        Value::F64(value) => value.to_string(),
        Value::String(value) => value.clone(),
        Value::EnumNumber(value) => value.to_string(),
        Value::Bytes(value) => value.iter().map(|byte| format!("{byte:02x}")).collect(),
        Value::Message(message) => serde_json::to_string(message).unwrap_or_default(),
        Value::List(list) => format!("{} values", list.len()),
        Value::Map(map) => format!("{} entries", map.len()),
    };
    shorten(text)
}

fn shorten(text: String) -> String {
    match text.char_indices().nth(SHOWN) {
        Some((at, _)) => format!("{}...", &text[..at]),
        None => text,
    }
}

/// How many characters of a value are shown.
const SHOWN: usize = 120;

/// The first field in which two envelopes differ, their place in the order of events included.
pub(crate) fn envelopes(a: &RecordRef<'_>, b: &RecordRef<'_>) -> Option<FieldDiff> {
    let text = [
        ("sender", a.sender, b.sender),
        ("receiver", a.receiver, b.receiver),
        ("kind", a.kind, b.kind),
        ("fate", a.class.name(), b.class.name()),
        ("link", a.link, b.link),
        ("reason", a.reason, b.reason),
        ("source", a.key.source, b.key.source),
        ("note", a.note, b.note),
    ];
    let number = [
        ("ordinal", a.ordinal, b.ordinal),
        ("copy", u64::from(a.copy), u64::from(b.copy)),
        ("time_ns", a.key.time_ns, b.key.time_ns),
        ("sent_ns", a.sent_ns, b.sent_ns),
        ("step", u64::from(a.key.step), u64::from(b.key.step)),
        ("tie", u64::from(a.key.tie), u64::from(b.key.tie)),
        ("count", a.key.count, b.key.count),
    ];
    let text = text.into_iter().find(|(_, a, b)| a != b);
    let number = number.into_iter().find(|(_, a, b)| a != b);
    text.map(|(field, a, b)| FieldDiff::new(field, a, b))
        .or_else(|| number.map(|(field, a, b)| FieldDiff::new(field, a, b)))
        .or_else(|| {
            let show = |m: Option<u64>| m.map_or("absent".to_owned(), |m| m.to_string());
            let differ = a.match_key != b.match_key;
            differ.then(|| FieldDiff::new("match_key", show(a.match_key), show(b.match_key)))
        })
}

/// The cause of two envelopes, if it differs.
pub(crate) fn causes(a: &RecordRef<'_>, b: &RecordRef<'_>) -> Option<FieldDiff> {
    let show = |record: &RecordRef<'_>| match record.cause {
        Some(key) => format!(
            "{} s from {} #{}",
            seconds(key.time_ns),
            key.source,
            key.count
        ),
        None => "absent".to_owned(),
    };
    (a.cause != b.cause).then(|| FieldDiff::new("cause", show(a), show(b)))
}
