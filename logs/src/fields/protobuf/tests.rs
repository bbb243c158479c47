//! Messages and schemas that are written here byte by byte.

use prost::Message;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{
    DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet, MessageOptions,
};

use super::*;
use crate::wire::{put_bytes, put_varint};

fn field(name: &str, number: i32, kind: Type) -> FieldDescriptorProto {
    FieldDescriptorProto {
        name: Some(name.to_owned()),
        number: Some(number),
        r#type: Some(kind as i32),
        label: Some(Label::Optional as i32),
        ..Default::default()
    }
}

fn of_type(field: FieldDescriptorProto, name: &str) -> FieldDescriptorProto {
    FieldDescriptorProto {
        type_name: Some(name.to_owned()),
        ..field
    }
}

fn repeated(field: FieldDescriptorProto) -> FieldDescriptorProto {
    FieldDescriptorProto {
        label: Some(Label::Repeated as i32),
        ..field
    }
}

fn types(message: DescriptorProto, syntax: &str) -> Result<Types, String> {
    let name = format!("t.{}", message.name());
    let file = FileDescriptorProto {
        package: Some("t".to_owned()),
        syntax: Some(syntax.to_owned()),
        message_type: vec![message],
        ..Default::default()
    };
    // A file that is there twice is read once.
    let file = vec![file.clone(), file];
    Types::read(&FileDescriptorSet { file }.encode_to_vec(), &name)
}

fn message(name: &str, field: Vec<FieldDescriptorProto>) -> DescriptorProto {
    DescriptorProto {
        name: Some(name.to_owned()),
        field,
        ..Default::default()
    }
}

fn found(a: &[u8], b: &[u8], types: &Result<Types, String>) -> Option<FieldDiff> {
    protobuf(
        "",
        &Encoded::of(a, types),
        &Encoded::of(b, types),
        &Rules::default(),
    )
}

fn words(diff: &FieldDiff) -> (&str, &str, &str) {
    (&diff.field, &diff.a, &diff.b)
}

fn number(tag: u32, value: u64) -> Vec<u8> {
    let mut out = Vec::new();
    put_varint(&mut out, u64::from(tag) << 3);
    put_varint(&mut out, value);
    out
}

fn bytes(tag: u32, value: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    put_bytes(&mut out, tag, value);
    out
}

#[test]
fn types_that_refer_to_themselves_are_compared_as_deep_as_they_are() {
    let tree = message(
        "Tree",
        vec![
            field("v", 1, Type::Int32),
            of_type(field("left", 2, Type::Message), ".t.Tree"),
        ],
    );
    let types = types(tree, "proto3");
    let diff = found(&number(1, 1), &number(1, 2), &types).unwrap();
    assert_eq!(words(&diff), ("v", "1", "2"));
    let nested =
        |depth: usize, value: u64| (0..depth).fold(number(1, value), |inner, _| bytes(2, &inner));
    let diff = found(&nested(3, 1), &nested(3, 2), &types).unwrap();
    assert_eq!(words(&diff), ("left.left.left.v", "1", "2"));
    let diff = found(&nested(5000, 1), &nested(5000, 2), &types).unwrap();
    assert!(diff.why.unwrap().contains("too deep"));
}

#[test]
fn values_that_look_alike_are_shown_with_their_types() {
    let with = |kind| types(message("M", vec![field("x", 1, kind)]), "proto3");
    let (float, double) = (with(Type::Float), with(Type::Double));
    let mut a = vec![0x0d];
    a.extend(2.5f32.to_le_bytes());
    let mut b = vec![0x09];
    b.extend(2.5f64.to_le_bytes());
    let diff = protobuf(
        "",
        &Encoded::of(&a, &float),
        &Encoded::of(&b, &double),
        &Rules::new(1.0, None),
    )
    .unwrap();
    assert_eq!(words(&diff), ("x", "2.5 (float)", "2.5 (double)"));
    let text = with(Type::String);
    let long = "x".repeat(1000);
    let [a, b] = ["a", "b"].map(|end| bytes(1, format!("{long}{end}").as_bytes()));
    let diff = found(&a, &b, &text).unwrap();
    assert_ne!(diff.a, diff.b);
    // The same bytes read as two types.
    let unsigned = with(Type::Uint64);
    let signed = with(Type::Sint64);
    let one = number(1, 1);
    let diff = protobuf(
        "",
        &Encoded::of(&one, &unsigned),
        &Encoded::of(&one, &signed),
        &Rules::default(),
    );
    assert_eq!(words(&diff.unwrap()), ("x", "1 (uint64)", "-1 (sint64)"));
}

#[test]
fn maps_of_any_key_are_compared_by_key() {
    let entry = DescriptorProto {
        name: Some("MEntry".to_owned()),
        field: vec![
            field("key", 1, Type::Double),
            field("value", 2, Type::Int32),
        ],
        options: Some(MessageOptions {
            map_entry: Some(true),
            ..Default::default()
        }),
        ..Default::default()
    };
    let map = DescriptorProto {
        nested_type: vec![entry],
        ..message(
            "M",
            vec![repeated(of_type(
                field("m", 1, Type::Message),
                ".t.M.MEntry",
            ))],
        )
    };
    let types = types(map, "proto3");
    let entry = |key: f64, value: u64| {
        let mut entry = vec![0x09];
        entry.extend(key.to_le_bytes());
        entry.extend(number(2, value));
        bytes(1, &entry)
    };
    let a = [entry(0.5, 1), entry(1.5, 2)].concat();
    let b = [entry(1.5, 2), entry(0.5, 1)].concat();
    assert_eq!(found(&a, &b, &types), None);
    let c = [entry(1.5, 3), entry(0.5, 1)].concat();
    assert_eq!(words(&found(&a, &c, &types).unwrap()), ("m[1.5]", "2", "3"));
    let diff = found(&a, &entry(0.5, 1), &types).unwrap();
    assert_eq!(words(&diff), ("m[1.5]", "present", "absent"));
}

#[test]
fn packed_and_unpacked_groups_oneofs_and_unknown_fields() {
    let list = types(
        message("M", vec![repeated(field("x", 1, Type::Int32))]),
        "proto3",
    );
    let unpacked = [number(1, 7), number(1, 8)].concat();
    assert_eq!(found(&unpacked, &bytes(1, &[7, 8]), &list), None);
    let diff = found(&unpacked, &bytes(1, &[7, 8, 9]), &list).unwrap();
    assert_eq!(words(&diff), ("x.length", "2", "3"));
    // A group within a group that is not declared.
    let group = |value: u64| [vec![0x33, 0x3b], number(1, value), vec![0x3c, 0x34]].concat();
    let diff = found(&group(1), &group(2), &list).unwrap();
    assert_eq!(diff.field, "unknown field 6");
    assert!(diff.a != diff.b && found(&group(1), &group(1), &list).is_none());
    let deep = [vec![0x33; 100_000], vec![0x34; 100_000]].concat();
    assert!(found(&deep, &group(1), &list).is_some());
    let mut fields = vec![field("x", 1, Type::Int32), field("y", 2, Type::Int32)];
    for field in &mut fields {
        field.oneof_index = Some(0);
    }
    let oneof = types(message("M", fields), "proto3");
    assert_eq!(
        found(
            &[number(1, 3), number(2, 4)].concat(),
            &number(2, 4),
            &oneof
        ),
        None
    );
    assert_eq!(
        words(&found(&number(1, 0), &[], &oneof).unwrap()),
        ("x", "0", "absent")
    );
}

#[test]
fn what_is_missing_in_a_schema_is_compared_by_bytes() {
    let lacks = of_type(field("x", 1, Type::Message), ".other.Missing");
    let types = types(message("M", vec![lacks]), "proto3");
    let (a, b) = (bytes(1, &number(1, 1)), bytes(1, &number(1, 2)));
    let diff = found(&a, &b, &types).unwrap();
    assert!(diff.field == "x" && diff.why.unwrap().contains("does not declare"));
    assert_eq!(found(&a, &a, &types), None);
    let none = Types::read(b"\xff\xff", "M");
    assert!(found(&a, &b, &none).unwrap().why.is_some());
    let other = Types::read(&[], "M");
    assert!(
        found(&a, &b, &other)
            .unwrap()
            .why
            .unwrap()
            .contains("declares no message M")
    );
}
