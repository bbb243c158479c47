//! Messages of other programs as values: CDR and ROS 1 by the definitions of their types, FlatBuffers by
//! reflection. Protobuf and JSON are in `fields`, which has the values of all.
//!
//! Schemas and messages come from other people's files. A schema may refer to itself, a message may say
//! that it has more than it has: whatever they are, there is a value or an error, in time and memory
//! that go with the bytes of the message and [`VALUES`](crate::value::VALUES).

pub(crate) mod cdr;
pub(crate) mod flat;
pub(crate) mod idl;
pub(crate) mod rosmsg;
pub(crate) mod structs;

use flat::FlatSchema;
use structs::Structs;

use crate::value::Unreadable;

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

    /// Reads a schema, by how it is written, of the message of this name.
    pub(crate) fn read(encoding: &str, name: &str, data: &[u8]) -> Result<Layout, Unreadable> {
        let text = || {
            let text = std::str::from_utf8(data);
            text.map_err(|_| Unreadable::new("the schema is not UTF-8"))
        };
        match encoding {
            "ros2msg" => rosmsg::read(name, text()?, rosmsg::Version::Two),
            "ros1msg" => rosmsg::read(name, text()?, rosmsg::Version::One),
            "ros2idl" | "omgidl" => idl::read(name, text()?),
            "flatbuffer" => {
                return FlatSchema::read(data, name).map(Layout::Flat);
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
