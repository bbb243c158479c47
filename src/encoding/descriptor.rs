//! Writes the flat schema as a `google.protobuf.FileDescriptorProto`.
//!
//! The few messages needed are written by hand, with the field numbers of protobuf's own
//! `descriptor.proto`: the kernel does without a protobuf library.

use super::flat::{Card, Field, FlatSchema, Scope, Shape, ValueType};
use super::wire::{Tag, Wire, put_bytes, put_varint};

/// Protobuf's numbers for field types.
mod types {
    pub(super) const DOUBLE: u64 = 1;
    pub(super) const FLOAT: u64 = 2;
    pub(super) const INT64: u64 = 3;
    pub(super) const UINT64: u64 = 4;
    pub(super) const INT32: u64 = 5;
    pub(super) const BOOL: u64 = 8;
    pub(super) const STRING: u64 = 9;
    pub(super) const MESSAGE: u64 = 11;
    pub(super) const BYTES: u64 = 12;
    pub(super) const UINT32: u64 = 13;
    pub(super) const ENUM: u64 = 14;
}

const LABEL_OPTIONAL: u64 = 1;
const LABEL_REPEATED: u64 = 3;

fn bytes(out: &mut Vec<u8>, number: u32, content: &[u8]) {
    put_bytes(out, Tag::new(number, Wire::Bytes), content);
}

fn varint(out: &mut Vec<u8>, number: u32, value: u64) {
    put_varint(out, Tag::new(number, Wire::Varint), value);
}

/// One file that holds the root message, and within it every type that it uses.
pub(super) fn file(flat: &FlatSchema, file_name: &str, package: &str) -> Vec<u8> {
    let mut out = Vec::new();
    bytes(&mut out, 1, file_name.as_bytes());
    bytes(&mut out, 2, package.as_bytes());
    bytes(&mut out, 4, &message(flat, 0, package));
    bytes(&mut out, 12, b"proto3");
    out
}

fn message(flat: &FlatSchema, id: usize, package: &str) -> Vec<u8> {
    let this = &flat.messages[id];
    let mut out = Vec::new();
    bytes(&mut out, 1, this.name.as_bytes());
    let is_oneof = this.shape == Shape::Oneof;
    let mut oneofs: Vec<String> = Vec::new();
    if is_oneof && !this.fields.is_empty() {
        oneofs.push("variant".to_owned());
    }
    for (position, one) in this.fields.iter().enumerate() {
        let optional = one.card == Card::Optional && !matches!(one.kind, ValueType::Message(_));
        let oneof = if is_oneof {
            Some(0)
        } else if optional {
            oneofs.push(synthetic_oneof(&this.fields, &oneofs, &one.name));
            Some(oneofs.len() - 1)
        } else {
            None
        };
        bytes(
            &mut out,
            2,
            &field(flat, one, position + 1, oneof, optional, package),
        );
    }
    for (other, candidate) in flat.messages.iter().enumerate() {
        let here =
            candidate.scope == Scope::MapEntry(id) || (id == 0 && candidate.scope == Scope::Root);
        if here {
            bytes(&mut out, 3, &message(flat, other, package));
        }
    }
    if id == 0 {
        for one in &flat.enums {
            bytes(&mut out, 4, &enumeration(one));
        }
    }
    if matches!(this.scope, Scope::MapEntry(_)) {
        let mut options = Vec::new();
        varint(&mut options, 7, 1);
        bytes(&mut out, 7, &options);
    }
    for oneof in oneofs {
        let mut declaration = Vec::new();
        bytes(&mut declaration, 1, oneof.as_bytes());
        bytes(&mut out, 8, &declaration);
    }
    out
}

/// Protobuf's own naming: `_` before the field's name, then `X` until it is free.
fn synthetic_oneof(fields: &[Field], oneofs: &[String], name: &str) -> String {
    let mut free = format!("_{name}");
    while fields.iter().any(|field| field.name == free) || oneofs.contains(&free) {
        free.insert(0, 'X');
    }
    free
}

fn field(
    flat: &FlatSchema,
    field: &Field,
    number: usize,
    oneof: Option<usize>,
    optional: bool,
    package: &str,
) -> Vec<u8> {
    let mut out = Vec::new();
    let repeated = matches!(field.card, Card::Repeated | Card::Map);
    bytes(&mut out, 1, field.name.as_bytes());
    varint(&mut out, 3, number as u64);
    varint(
        &mut out,
        4,
        if repeated {
            LABEL_REPEATED
        } else {
            LABEL_OPTIONAL
        },
    );
    let (code, type_name) = match field.kind {
        ValueType::Bool => (types::BOOL, None),
        ValueType::I32 => (types::INT32, None),
        ValueType::I64 => (types::INT64, None),
        ValueType::U32 => (types::UINT32, None),
        ValueType::U64 => (types::UINT64, None),
        ValueType::F32 => (types::FLOAT, None),
        ValueType::F64 => (types::DOUBLE, None),
        ValueType::Char | ValueType::Str => (types::STRING, None),
        ValueType::Pending => unreachable!("no field is of this kind"),
        ValueType::Bytes | ValueType::I128 | ValueType::U128 => (types::BYTES, None),
        ValueType::Enum(id) => {
            let root = &flat.messages[0].name;
            (
                types::ENUM,
                Some(format!(".{package}.{root}.{}", flat.enums[id].name)),
            )
        }
        ValueType::Message(id) => (
            types::MESSAGE,
            Some(format!(".{package}.{}", path(flat, id))),
        ),
    };
    varint(&mut out, 5, code);
    if let Some(type_name) = type_name {
        bytes(&mut out, 6, type_name.as_bytes());
    }
    if let Some(oneof) = oneof {
        varint(&mut out, 9, oneof as u64);
    }
    if optional {
        varint(&mut out, 17, 1);
    }
    out
}

/// A message's name within the package.
fn path(flat: &FlatSchema, id: usize) -> String {
    let message = &flat.messages[id];
    match message.scope {
        Scope::Top => message.name.clone(),
        Scope::Root => format!("{}.{}", flat.messages[0].name, message.name),
        Scope::MapEntry(owner) => format!("{}.{}", path(flat, owner), message.name),
    }
}

fn enumeration(one: &super::flat::Enumeration) -> Vec<u8> {
    let mut out = Vec::new();
    bytes(&mut out, 1, one.name.as_bytes());
    for (number, value) in one.values.iter().enumerate() {
        let mut declaration = Vec::new();
        bytes(&mut declaration, 1, value.name.as_bytes());
        varint(&mut declaration, 2, number as u64);
        bytes(&mut out, 2, &declaration);
    }
    out
}
