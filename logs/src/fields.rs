//! Comparing two messages field by field, and naming the first field that differs.

mod json;
mod protobuf;
mod rules;
mod values;

use std::fmt;
use std::sync::Arc;

use crate::channel::{ChannelInfo, SchemaInfo};
use crate::decode::{Layout, cdr};
use crate::envelope::RecordRef;
use crate::shown::{Seconds, apart, hex};
use crate::value::{Unreadable, Value};

pub(crate) use json::json_value;
pub(crate) use protobuf::{Encoded, protobuf, protobuf_value};
pub use rules::Tolerance;
pub(crate) use rules::{Bound, Rules};
pub(crate) use values::{Differs, each, first};

/// What a message on a channel says; `others` are the channels of its log, whose types it may hold.
///
/// # Errors
/// If its encoding or its schema is not known, or it does not hold what its schema says.
pub(crate) fn value<'a>(
    channel: &'a ChannelInfo,
    data: &'a [u8],
    others: &'a [Arc<ChannelInfo>],
) -> Result<Value<'a>, Unreadable> {
    let schema = || {
        let missing = || Unreadable::new("the channel has no schema");
        channel.schema.as_deref().ok_or_else(missing)
    };
    match channel.encoding.as_str() {
        encoding @ ("cdr" | "ros1" | "flatbuffer") => match (encoding, schema()?.layout()?) {
            ("cdr", Layout::Structs(structs)) => cdr::cdr(structs, data),
            ("ros1", Layout::Structs(structs)) => cdr::ros1(structs, data),
            ("flatbuffer", Layout::Flat(schema)) => schema.value(data),
            _ => {
                let what = format!("a schema that is not for messages encoded as {encoding:?}");
                Err(Unreadable::new(what))
            }
        },
        "json" => json_value(data),
        "protobuf" => protobuf_value(data, schema()?, others),
        other => {
            let what = format!("messages that are encoded as {other:?} are not read");
            Err(Unreadable::new(what))
        }
    }
}

/// The first field in which two things differ, with both values.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FieldDiff {
    pub(crate) field: String,
    pub(crate) a: String,
    pub(crate) b: String,
    /// Why only bytes are compared, where more was wanted.
    pub(crate) why: Option<String>,
}

impl FieldDiff {
    pub(crate) fn new(field: impl Into<String>, a: impl ToString, b: impl ToString) -> Self {
        FieldDiff {
            field: field.into(),
            a: a.to_string(),
            b: b.to_string(),
            why: None,
        }
    }

    /// Two texts, shown where they differ.
    pub(crate) fn texts(field: impl Into<String>, a: &str, b: &str) -> Self {
        let (a, b) = apart(a, b);
        FieldDiff::new(field, a, b)
    }

    pub(crate) fn because(self, why: impl Into<String>) -> Self {
        FieldDiff {
            why: Some(why.into()),
            ..self
        }
    }
}

/// The way to a value within a message; written out only where something differs.
pub(crate) enum Path<'a> {
    Root(&'a str),
    Field(&'a Path<'a>, &'a str),
    Entry(&'a Path<'a>, &'a dyn fmt::Display),
}

impl Path<'_> {
    /// Whether it leads to this field; elements of lists and entries of maps are all the same field.
    pub(crate) fn is(&self, steps: &[String]) -> bool {
        match (self, steps.split_last()) {
            (Path::Root(""), last) => last.is_none(),
            (Path::Root(name), Some((last, []))) => name == last,
            (Path::Field(path, name), Some((last, rest))) => name == last && path.is(rest),
            (Path::Entry(path, _), _) => path.is(steps),
            _ => false,
        }
    }
}

impl fmt::Display for Path<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Path::Root(name) => f.write_str(name),
            Path::Field(Path::Root(""), name) => f.write_str(name),
            Path::Field(path, name) => write!(f, "{path}.{name}"),
            Path::Entry(path, entry) => write!(f, "{path}[{entry}]"),
        }
    }
}

pub(crate) use crate::value::DEPTH;

/// The first field in which two envelopes' bodies differ, read with the schemas of the envelopes.
pub(crate) fn bodies(
    a: (&[u8], Option<&SchemaInfo>),
    b: (&[u8], Option<&SchemaInfo>),
    rules: &Rules,
) -> Option<FieldDiff> {
    let encoded = |(bytes, schema): (_, Option<_>)| Encoded::body(bytes, schema);
    protobuf("body", &encoded(a), &encoded(b), rules)
}

/// The schema of a channel, as a reference.
pub(crate) fn schema(channel: &ChannelInfo) -> Option<&SchemaInfo> {
    channel.schema.as_deref()
}

/// The first byte in which two messages differ.
pub(crate) fn raw(field: impl Into<String>, a: &[u8], b: &[u8]) -> FieldDiff {
    let at = a.iter().zip(b).position(|(x, y)| x != y);
    let at = at.unwrap_or(a.len().min(b.len()));
    let show = |bytes: &[u8]| {
        let shown = bytes.get(at..).unwrap_or_default();
        let shown = &shown[..shown.len().min(16)];
        format!("{} bytes, from byte {at}: {}", bytes.len(), hex(shown))
    };
    FieldDiff::new(field, show(a), show(b))
}

/// True if two numbers differ by at most the tolerance, absolutely or relative to the larger one.
/// A number that is infinite or none is near to nothing but itself; without a tolerance 0 and -0
/// are two numbers.
pub(crate) fn near(a: f64, b: f64, tolerance: f64) -> bool {
    if a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan()) {
        return true;
    }
    if tolerance <= 0.0 || !a.is_finite() || !b.is_finite() {
        return false;
    }
    let apart = (a - b).abs();
    apart <= tolerance || apart <= tolerance * a.abs().max(b.abs())
}

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
    text.map(|(field, a, b)| FieldDiff::texts(field, a, b))
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
        Some(key) => {
            let (time, source) = (Seconds(key.time_ns), key.source);
            format!("{time} s, step {}, from {source} #{}", key.step, key.count)
        }
        None => "absent".to_owned(),
    };
    (a.cause != b.cause).then(|| FieldDiff::new("cause", show(a), show(b)))
}

#[cfg(test)]
mod tests {
    use super::near;

    #[test]
    fn a_tolerance_is_absolute_or_a_share_of_the_larger_one() {
        // Far more apart than the tolerance, and less than its share.
        assert!(near(1e9, 1e9 + 100.0, 1e-6) && !near(1e9, 1e9 + 10_000.0, 1e-6));
        // Less apart than the tolerance, and far more than its share.
        assert!(near(0.0, 5e-7, 1e-6) && !near(0.0, 2e-6, 1e-6));
        assert!(near(-1e-9, 1e-9, 1e-6) && !near(1.0, 1.0 + 1e-12, 0.0));
    }

    #[test]
    fn infinity_and_no_number_are_near_to_themselves_only() {
        let numbers = [
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::NAN,
            1.0,
            f64::MAX,
            0.0,
        ];
        for (i, a) in numbers.iter().enumerate() {
            for (j, b) in numbers.iter().enumerate() {
                assert_eq!(near(*a, *b, 1e-9), i == j, "{a} {b}");
            }
        }
        assert!(near(1.0, 1.0 + 1e-10, 1e-9) && !near(1.0, 1.0 + 1e-8, 1e-9));
        assert!(near(0.0, -0.0, 1e-9) && !near(0.0, -0.0, 0.0));
    }
}
