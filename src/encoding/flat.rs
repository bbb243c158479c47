//! The flat schema, as encoder, decoder and descriptor read it: tables of messages and enums.

use std::fmt;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use super::wire::{Tag, Wire};

/// Messages may nest this deep. Common readers stop at 100, and a log's envelope adds levels.
pub(super) const MAX_DEPTH: u32 = 96;

/// Everything about one root message type; the root is message 0.
#[derive(Debug)]
pub(super) struct FlatSchema {
    pub(super) messages: Vec<Message>,
    pub(super) enums: Vec<Enumeration>,
    /// A field that holds the root message and writes neither tag nor length.
    pub(super) root: Field,
}

/// One protobuf message type.
#[derive(Debug)]
pub(super) struct Message {
    /// The simple name in protobuf.
    pub(super) name: String,
    pub(super) scope: Scope,
    pub(super) shape: Shape,
    pub(super) fields: Vec<Field>,
    /// Set while a type is traced, to see its defaults: fields that `Deserialize` can do without
    /// are kept from it.
    pub(super) withheld: AtomicBool,
}

/// Where a message type is declared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scope {
    /// It is the root.
    Top,
    /// Inside the root.
    Root,
    /// Inside the message of this index: protobuf wants map entries beside their field.
    MapEntry(usize),
}

/// What of serde's data model a message stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    /// A unit or unit struct.
    Unit,
    /// A struct, or a struct variant's content.
    Struct,
    /// A tuple of mixed types, a tuple struct, or a tuple variant's content.
    Tuple,
    /// A newtype struct that could not be replaced by what it holds.
    Newtype,
    /// A helper around one option, collection or map, where protobuf allows none.
    Wrapper,
    /// An enum with data, as a oneof.
    Oneof,
    /// One entry of a map.
    Entry,
}

impl fmt::Display for Shape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Shape::Unit => "a unit",
            Shape::Struct => "a struct",
            Shape::Tuple => "a tuple",
            Shape::Newtype => "a newtype struct",
            Shape::Wrapper => "an option or collection",
            Shape::Oneof => "an enum with data",
            Shape::Entry => "a map entry",
        })
    }
}

/// One field of a message; its number is its position plus one.
#[derive(Debug)]
pub(super) struct Field {
    pub(super) tag: Tag,
    pub(super) kind: ValueType,
    pub(super) card: Card,
    pub(super) packed: bool,
    /// What an encoder may write at once: the kind, or `Pending` where the cardinality comes
    /// first. One comparison of it checks both.
    pub(super) first: ValueType,
    /// How each value of an option or a sequence is written, where this field is one.
    pub(super) element: Option<Box<Field>>,
    /// The serde name.
    pub(super) key: Key,
    /// Set when a reader was seen to reject the field's absence. Such a field reads as zero where
    /// it is absent; the others are left to `#[serde(default)]`.
    pub(super) required: AtomicBool,
    /// Set when `Serialize` was seen to leave the field out.
    pub(super) left_out: AtomicBool,
    /// The protobuf name.
    pub(super) name: String,
    /// For error messages, as in `Ping.count`.
    pub(super) place: String,
}

/// How many values a field holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Card {
    /// Exactly one, always written.
    Single,
    /// None or one.
    Optional,
    /// A sequence.
    Repeated,
    /// Entries, sorted by encoded key.
    Map,
}

/// The type of one value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ValueType {
    Bool,
    I32,
    I64,
    U32,
    U64,
    F32,
    F64,
    Char,
    Str,
    Bytes,
    I128,
    U128,
    Enum(usize),
    Message(usize),
    /// An option, sequence or map must come first.
    Pending,
}

impl ValueType {
    pub(super) fn wire(self) -> Wire {
        match self {
            ValueType::Bool
            | ValueType::I32
            | ValueType::I64
            | ValueType::U32
            | ValueType::U64
            | ValueType::Enum(_) => Wire::Varint,
            ValueType::F32 => Wire::Fixed32,
            ValueType::F64 => Wire::Fixed64,
            ValueType::Char
            | ValueType::Str
            | ValueType::Bytes
            | ValueType::I128
            | ValueType::U128 => Wire::Bytes,
            ValueType::Message(_) | ValueType::Pending => Wire::Bytes,
        }
    }

    /// The bytes of each value, where all values take the same.
    pub(super) fn width(self) -> Option<usize> {
        match self {
            ValueType::F32 => Some(4),
            ValueType::F64 => Some(8),
            _ => None,
        }
    }
}

/// One protobuf enum: a Rust enum without data.
#[derive(Debug)]
pub(super) struct Enumeration {
    pub(super) name: String,
    pub(super) values: Vec<Value>,
}

/// One value of an enum; its number is its position.
#[derive(Debug)]
pub(super) struct Value {
    pub(super) key: Key,
    pub(super) name: String,
}

/// A serde name, compared by address where it can be.
#[derive(Debug)]
pub(super) struct Key {
    pub(super) name: &'static str,
    /// The address at which `Serialize` keeps its copy of the name, learned at the first write.
    /// It only saves the comparison of text: the answer never depends on it.
    seen: AtomicUsize,
}

impl Key {
    pub(super) fn new(name: &'static str) -> Key {
        Key {
            name,
            seen: AtomicUsize::new(0),
        }
    }

    /// Is this the name?
    #[inline(always)]
    pub(super) fn is(&self, name: &'static str) -> bool {
        let address = name.as_ptr() as usize;
        (self.seen.load(Ordering::Relaxed) == address && self.name.len() == name.len())
            || self.learn(name)
    }

    #[cold]
    fn learn(&self, name: &'static str) -> bool {
        let same = self.name == name;
        if same && !name.is_empty() {
            // Only the first is kept: a second copy of the literal must not make threads fight
            // over the cache line.
            let address = name.as_ptr() as usize;
            let _ = self
                .seen
                .compare_exchange(0, address, Ordering::Relaxed, Ordering::Relaxed);
        }
        same
    }
}

impl FlatSchema {
    /// Says what a field expects, for error messages.
    pub(super) fn describe(&self, field: &Field, card: Card) -> String {
        let kind = match field.kind {
            ValueType::Enum(id) => format!("the enum `{}`", self.enums[id].name),
            ValueType::Message(id) => {
                format!("{} (`{}`)", self.messages[id].shape, self.messages[id].name)
            }
            scalar => format!("{scalar:?}").to_lowercase(),
        };
        match card {
            Card::Single => kind,
            Card::Optional => format!("an option of {kind}"),
            Card::Repeated => format!("a sequence of {kind}"),
            Card::Map => format!("a map as {kind}"),
        }
    }
}
