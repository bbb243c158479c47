//! Protobuf descriptors of what a log holds, so that other programs read it field by field.

use farside::Kind;
use prost::Message;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{
    DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet,
    OneofDescriptorProto,
};

use crate::envelope::field as number;

/// The file that declares what all kinds share.
const SHARED_FILE: &str = "farside/log.proto";

/// A schema for a channel: its name and its descriptor set.
pub(crate) struct SchemaOf {
    pub(crate) name: String,
    pub(crate) data: Vec<u8>,
}

/// The schema of records without a body: starts, crashes, restarts, the stop.
pub(crate) fn event() -> SchemaOf {
    SchemaOf {
        name: "farside.log.Event".to_owned(),
        data: set(vec![shared_file()]),
    }
}

/// The schema of checkpoints.
pub(crate) fn checkpoint() -> SchemaOf {
    SchemaOf {
        name: "farside.log.Checkpoint".to_owned(),
        data: set(vec![shared_file()]),
    }
}

/// The schema of a state sample: that of its own type.
pub(crate) fn sample(kind: &Kind) -> SchemaOf {
    SchemaOf {
        name: kind.schema().full_name(),
        data: kind.schema().file_descriptor_set(),
    }
}

/// The schema of records whose body is of this kind.
pub(crate) fn record(kind: &Kind) -> SchemaOf {
    let body = kind.schema().full_name();
    let name = body.rsplit('.').next().unwrap_or(&body).to_owned();
    let envelope = FileDescriptorProto {
        name: Some(format!("farside/record/{name}.proto")),
        package: Some("farside.record".to_owned()),
        dependency: vec![SHARED_FILE.to_owned(), kind.schema().file_name()],
        message_type: vec![envelope(&name, Some(format!(".{body}")))],
        syntax: Some("proto3".to_owned()),
        ..Default::default()
    };
    // Sets are concatenated: the files a file imports come before it.
    let mut data = kind.schema().file_descriptor_set();
    data.extend(set(vec![shared_file(), envelope]));
    SchemaOf {
        name: format!("farside.record.{name}"),
        data,
    }
}

fn set(file: Vec<FileDescriptorProto>) -> Vec<u8> {
    FileDescriptorSet { file }.encode_to_vec()
}

fn shared_file() -> FileDescriptorProto {
    let key = DescriptorProto {
        name: Some("EventKey".to_owned()),
        field: vec![
            field("time_ns", 1, Type::Uint64),
            field("step", 2, Type::Uint32),
            field("source", 3, Type::String),
            field("count", 4, Type::Uint64),
            field("tie", 5, Type::Uint32),
        ],
        ..Default::default()
    };
    let mut hashes = field("hashes", 4, Type::Fixed32);
    hashes.label = Some(Label::Repeated as i32);
    let checkpoint = DescriptorProto {
        name: Some("Checkpoint".to_owned()),
        field: vec![
            field("digest", 1, Type::String),
            message_field("key", 2, KEY),
            field("records", 3, Type::Uint64),
            hashes,
        ],
        ..Default::default()
    };
    FileDescriptorProto {
        name: Some(SHARED_FILE.to_owned()),
        package: Some("farside.log".to_owned()),
        message_type: vec![key, carriage(), checkpoint, envelope("Event", None)],
        syntax: Some("proto3".to_owned()),
        ..Default::default()
    }
}

const KEY: &str = ".farside.log.EventKey";
const CARRIAGE: &str = ".farside.log.Carriage";

fn carriage() -> DescriptorProto {
    DescriptorProto {
        name: Some("Carriage".to_owned()),
        field: vec![
            field("queue_ns", 1, Type::Uint64),
            field("serialization_ns", 2, Type::Uint64),
            field("propagation_ns", 3, Type::Uint64),
            field("jitter_ns", 4, Type::Sint64),
            field("retries_ns", 5, Type::Uint64),
            field("attempts", 6, Type::Uint32),
            field("energy_j", 7, Type::Double),
            field("receive_j", 8, Type::Double),
            field("fragments", 9, Type::Uint32),
        ],
        ..Default::default()
    }
}

fn envelope(name: &str, body: Option<String>) -> DescriptorProto {
    let mut match_key = field("match_key", number::MATCH_KEY, Type::Uint64);
    match_key.oneof_index = Some(0);
    match_key.proto3_optional = Some(true);
    let mut fields = vec![
        field("sender", number::SENDER, Type::String),
        field("receiver", number::RECEIVER, Type::String),
        field("link", number::LINK, Type::String),
        field("kind", number::KIND, Type::String),
        field("fate", number::FATE, Type::String),
        field("reason", number::REASON, Type::String),
        field("ordinal", number::ORDINAL, Type::Uint64),
        field("copy", number::COPY, Type::Uint32),
        field("time_ns", number::TIME_NS, Type::Uint64),
        field("step", number::STEP, Type::Uint32),
        field("source", number::SOURCE, Type::String),
        field("count", number::COUNT, Type::Uint64),
        field("sent_ns", number::SENT_NS, Type::Uint64),
        message_field("cause", number::CAUSE, KEY),
        match_key,
        field("tie", number::TIE, Type::Uint32),
        message_field("carriage", number::CARRIAGE, CARRIAGE),
    ];
    fields.push(match body {
        Some(body) => message_field("body", number::BODY, &body),
        None => field("note", number::NOTE, Type::String),
    });
    DescriptorProto {
        name: Some(name.to_owned()),
        field: fields,
        oneof_decl: vec![OneofDescriptorProto {
            name: Some("_match_key".to_owned()),
            options: None,
        }],
        ..Default::default()
    }
}

fn field(name: &str, number: u32, kind: Type) -> FieldDescriptorProto {
    FieldDescriptorProto {
        name: Some(name.to_owned()),
        number: Some(number as i32),
        label: Some(Label::Optional as i32),
        r#type: Some(kind as i32),
        ..Default::default()
    }
}

fn message_field(name: &str, number: u32, type_name: &str) -> FieldDescriptorProto {
    FieldDescriptorProto {
        type_name: Some(type_name.to_owned()),
        ..field(name, number, Type::Message)
    }
}
