//! Messages of any encoding as values: CDR and ROS 1 by the definitions of their types, protobuf by
//! its descriptors, FlatBuffers by reflection, JSON as it is.
//!
//! Schemas and messages come from other people's files. A schema may refer to itself, a message may say
//! that it has more than it has: whatever they are, there is a value or an error, in time and memory
//! that go with the bytes of the message and [`VALUES`].

pub(crate) mod cdr;
pub(crate) mod flat;
pub(crate) mod idl;
pub(crate) mod rosmsg;
pub(crate) mod structs;

use std::sync::Arc;

use flat::FlatSchema;
use structs::Structs;

use crate::scan::{ChannelInfo, SchemaInfo};
use crate::value::Value;

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

/// How a schema that is no protobuf describes its messages.
#[derive(Debug)]
pub(crate) enum Layout {
    /// Structs whose fields follow each other.
    Structs(Structs),
    /// Tables that say where their fields are.
    Flat(FlatSchema),
}

impl Layout {
    /// Calls `each` with every field that messages may have, as long as it says so.
    pub(crate) fn fields(&self, each: &mut dyn FnMut(&str) -> bool, depth: usize) {
        match self {
            Layout::Structs(structs) => structs.fields(each, depth),
            Layout::Flat(schema) => schema.fields(each, depth),
        }
    }

    /// Reads a schema.
    pub(crate) fn read(schema: &SchemaInfo) -> Result<Layout, Unreadable> {
        let text = || {
            let text = std::str::from_utf8(&schema.data);
            text.map_err(|_| Unreadable::new("the schema is not UTF-8"))
        };
        match schema.encoding.as_str() {
            "ros2msg" => rosmsg::read(&schema.name, text()?, rosmsg::Version::Two),
            "ros1msg" => rosmsg::read(&schema.name, text()?, rosmsg::Version::One),
            "ros2idl" | "omgidl" => idl::read(&schema.name, text()?),
            "flatbuffer" => {
                return FlatSchema::read(&schema.data, &schema.name).map(Layout::Flat);
            }
            "" => return Err(Unreadable::new("the channel has no schema")),
            other => {
                let what = format!("a schema that is written as {other:?} is not read");
                return Err(Unreadable::new(what));
            }
        }
        .map(Layout::Structs)
    }
}

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
        "json" => crate::fields::json_value(data),
        "protobuf" => crate::fields::protobuf_value(data, schema()?, others),
        other => {
            let what = format!("messages that are encoded as {other:?} are not read");
            Err(Unreadable::new(what))
        }
    }
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
