//! Descriptor sets of the type `p.M`, most of them with a field `v` of number 1, that a reader must
//! survive.

use prost::Message as _;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet};

pub(crate) fn field(name: &str, number: i32, kind: Type, type_name: &str) -> FieldDescriptorProto {
    FieldDescriptorProto {
        name: Some(name.to_owned()),
        number: Some(number),
        r#type: Some(kind as i32),
        label: Some(Label::Optional as i32),
        type_name: Some(type_name.to_owned()).filter(|name| !name.is_empty()),
        ..Default::default()
    }
}

pub(crate) fn file_of(message: Vec<DescriptorProto>, syntax: &str) -> FileDescriptorProto {
    FileDescriptorProto {
        name: Some("m.proto".to_owned()),
        package: Some("p".to_owned()),
        syntax: Some(syntax.to_owned()),
        message_type: message,
        ..Default::default()
    }
}

pub(crate) fn type_of(name: &str, field: Vec<FieldDescriptorProto>) -> DescriptorProto {
    DescriptorProto {
        name: Some(name.to_owned()),
        field,
        ..Default::default()
    }
}

pub(crate) fn set(file: Vec<FileDescriptorProto>) -> Vec<u8> {
    FileDescriptorSet { file }.encode_to_vec()
}

/// What is wrong with a schema, and the schema.
pub(crate) fn hostile() -> Vec<(&'static str, Vec<u8>)> {
    let v = || field("v", 1, Type::Int32, "");
    let m = |fields| type_of("M", fields);
    // Two types that refer to each other.
    let pair = vec![
        m(vec![v(), field("n", 2, Type::Message, ".p.N")]),
        type_of("N", vec![field("m", 1, Type::Message, ".p.M")]),
    ];
    // A type that nests a thousand types, each with twenty fields of the next one.
    let wide = (0..1000).map(|at| {
        let next = format!(".p.T{}", at + 1);
        let of = |number| field(&format!("f{number}"), number, Type::Message, &next);
        type_of(&format!("T{at}"), (1..=20).map(of).collect())
    });
    let wide = std::iter::once(m(vec![v(), field("t", 2, Type::Message, ".p.T0")])).chain(wide);
    let nested = (0..3000).fold(type_of("X", vec![]), |inner, _| DescriptorProto {
        nested_type: vec![inner],
        ..type_of("X", vec![])
    });
    let missing = FileDescriptorProto {
        dependency: vec!["nowhere.proto".to_owned()],
        ..file_of(
            vec![m(vec![v(), field("x", 2, Type::Message, ".q.Gone")])],
            "proto3",
        )
    };
    let import_circle = FileDescriptorProto {
        dependency: vec!["m.proto".to_owned()],
        ..file_of(vec![m(vec![v()])], "proto3")
    };
    let same_number = m(vec![v(), field("w", 1, Type::String, "")]);
    let no_name = m(vec![v(), FieldDescriptorProto::default()]);
    vec![
        (
            "referring to each other",
            set(vec![file_of(pair, "proto3")]),
        ),
        ("wide", set(vec![file_of(wide.collect(), "proto3")])),
        (
            "a syntax to come",
            set(vec![file_of(vec![m(vec![v()])], "editions")]),
        ),
        ("missing import", set(vec![missing])),
        ("imports itself", set(vec![import_circle])),
        (
            "a number twice",
            set(vec![file_of(vec![same_number], "proto2")]),
        ),
        (
            "a field of no name",
            set(vec![file_of(vec![no_name], "proto2")]),
        ),
        (
            "nested deep",
            set(vec![file_of(vec![nested, m(vec![v()])], "proto3")]),
        ),
        ("no schema at all", vec![]),
        ("no descriptor set", b"\xff\xff\xff".to_vec()),
        ("text", b"message M { int32 v = 1; }".to_vec()),
    ]
}
