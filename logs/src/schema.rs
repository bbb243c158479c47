//! Protobuf schemas as far as a comparison needs them: for each message its fields, by number and
//! by name.
//!
//! Schemas come from other people's files. They may refer to themselves, lack an import, hold a
//! file twice, be of a syntax to come or have map keys that no compiler accepts. Nothing here
//! follows a reference before a message holds something there, and what cannot be resolved stays
//! unresolved: the bytes of such a field can still be compared.

use std::collections::BTreeMap;

use prost::Message;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{
    DescriptorProto, EnumDescriptorProto, FieldDescriptorProto, FileDescriptorProto,
    FileDescriptorSet,
};

use crate::value::within;

/// The messages of a schema, and which of them the schema is for.
#[derive(Debug)]
pub(crate) struct Types {
    messages: Vec<MessageType>,
    by_name: BTreeMap<String, usize>,
    /// The names of each enumeration's numbers.
    enums: Vec<BTreeMap<i32, String>>,
    root: usize,
}

/// A message type.
#[derive(Debug, Default)]
pub(crate) struct MessageType {
    pub(crate) name: String,
    pub(crate) fields: BTreeMap<u32, Field>,
    by_name: BTreeMap<String, u32>,
    pub(crate) map_entry: bool,
}

/// A field of a message type.
#[derive(Debug)]
pub(crate) struct Field {
    pub(crate) name: String,
    pub(crate) number: u32,
    pub(crate) kind: FieldType,
    pub(crate) repeated: bool,
    /// Absent is something else than zero.
    pub(crate) presence: bool,
    /// Which oneof of its message it belongs to.
    pub(crate) oneof: Option<i32>,
    /// The enumeration that it is of, by its place in the schema.
    names: Option<usize>,
}

/// The type of a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FieldType {
    /// Anything that is no message.
    Scalar(Type),
    /// A message or group, by its place in the schema; none if the schema does not declare it.
    Message(Option<usize>),
}

impl FieldType {
    /// The type's name in the schema language.
    pub(crate) fn name(self) -> String {
        match self {
            FieldType::Message(_) => "message".to_owned(),
            FieldType::Scalar(kind) => kind.as_str_name()[5..].to_lowercase(),
        }
    }

    /// True if values of the two can be compared as they are.
    pub(crate) fn is_like(self, other: FieldType) -> bool {
        match (self, other) {
            (FieldType::Message(_), FieldType::Message(_)) => true,
            (one, other) => one == other,
        }
    }
}

impl MessageType {
    /// The value, if this is the entry of a map.
    pub(crate) fn value_of_entry(&self) -> Option<&Field> {
        self.fields.get(&2)
    }

    /// The field of this name.
    pub(crate) fn named(&self, name: &str) -> Option<&Field> {
        self.fields.get(self.by_name.get(name)?)
    }
}

impl Types {
    /// Reads a descriptor set and finds the message `name` in it; `Err` says why there is none.
    pub(crate) fn read(data: &[u8], name: &str) -> Result<Types, String> {
        let set = FileDescriptorSet::decode(data)
            .map_err(|_| "the schema is no protobuf descriptor set".to_owned())?;
        let mut reader = Reader::default();
        for file in &set.file {
            reader.declare_file(file);
        }
        let Some(root) = reader.by_name.get(name).copied() else {
            return Err(format!("the schema declares no message {name}"));
        };
        for file in &set.file {
            reader.fields_of_file(file);
        }
        Ok(Types {
            messages: reader.messages,
            by_name: reader.by_name,
            enums: reader.enums,
            root,
        })
    }

    pub(crate) fn root(&self) -> usize {
        self.root
    }

    /// The place of a message by its whole name.
    pub(crate) fn find(&self, name: &str) -> Option<usize> {
        self.by_name.get(name).copied()
    }

    /// The name of a number of a field that is an enumeration.
    pub(crate) fn name_of(&self, field: &Field, number: i128) -> Option<&str> {
        let names = self.enums.get(field.names?)?;
        let name = names.get(&i32::try_from(number).ok()?);
        name.map(String::as_str)
    }

    /// Calls `each` with every field that messages may have, as long as it says so.
    pub(crate) fn fields(&self, each: &mut dyn FnMut(&str) -> bool, depth: usize) {
        self.fields_of(self.root, &mut String::new(), each, depth);
    }

    fn fields_of(
        &self,
        at: usize,
        path: &mut String,
        each: &mut dyn FnMut(&str) -> bool,
        depth: usize,
    ) -> bool {
        let mut goes_on = depth > 0;
        for field in self.messages[at].fields.values() {
            within(path, &field.name, &mut |path| {
                goes_on = goes_on && each(path);
                let FieldType::Message(Some(inner)) = field.kind else {
                    return;
                };
                let entry = &self.messages[inner];
                let inner = match entry.value_of_entry().filter(|_| entry.map_entry) {
                    None => Some(inner),
                    Some(value) => match value.kind {
                        FieldType::Message(inner) => inner,
                        FieldType::Scalar(_) => None,
                    },
                };
                if let Some(inner) = inner.filter(|_| goes_on) {
                    self.fields_of(inner, path, each, depth - 1);
                }
            });
        }
        goes_on
    }

    pub(crate) fn message(&self, at: usize) -> &MessageType {
        &self.messages[at]
    }

    /// Where two schemas differ in what messages can hold, in words; none if nowhere. Only what
    /// the two roots can reach counts.
    pub(crate) fn difference(&self, other: &Types) -> Option<String> {
        let mut seen = std::collections::BTreeSet::new();
        let mut next = vec![(self.root, other.root)];
        while let Some((one, two)) = next.pop() {
            if !seen.insert((one, two)) {
                continue;
            }
            let (a, b) = (&self.messages[one], &other.messages[two]);
            for number in a.fields.keys().chain(b.fields.keys()) {
                let (x, y) = (a.fields.get(number), b.fields.get(number));
                let (Some(x), Some(y)) = (x, y) else {
                    let word = |field: Option<&Field>| {
                        field.map_or("none".to_owned(), |field| field.name.clone())
                    };
                    let (x, y) = (word(x), word(y));
                    return Some(format!("field {number} of {} is {x} | {y}", a.name));
                };
                if x.says() != y.says() {
                    let (x, y) = (x.says(), y.says());
                    return Some(format!("field {number} of {} is {x} | {y}", a.name));
                }
                match (x.kind, y.kind) {
                    (FieldType::Message(Some(x)), FieldType::Message(Some(y))) => next.push((x, y)),
                    (x, y) if x.is_like(y) && matches!(x, FieldType::Scalar(_)) => {}
                    (FieldType::Message(None), FieldType::Message(None)) => {}
                    _ => {
                        let lacks = "has a type that one of the two does not declare";
                        return Some(format!("field {number} of {} {lacks}", a.name));
                    }
                }
            }
        }
        None
    }
}

impl Field {
    fn says(&self) -> String {
        let repeated = if self.repeated { "repeated " } else { "" };
        format!("{repeated}{} {}", self.kind.name(), self.name)
    }
}

#[derive(Default)]
struct Reader {
    messages: Vec<MessageType>,
    by_name: BTreeMap<String, usize>,
    enums: Vec<BTreeMap<i32, String>>,
    enums_by_name: BTreeMap<String, usize>,
    /// Messages whose fields are known: a file that is there twice is read once.
    done: std::collections::BTreeSet<usize>,
}

fn joined(scope: &str, name: &str) -> String {
    match scope {
        "" => name.to_owned(),
        scope => format!("{scope}.{name}"),
    }
}

impl Reader {
    fn declare_file(&mut self, file: &FileDescriptorProto) {
        for message in &file.message_type {
            self.declare(file.package(), message);
        }
        self.declare_enums(file.package(), &file.enum_type);
    }

    fn declare_enums(&mut self, scope: &str, enums: &[EnumDescriptorProto]) {
        for declared in enums {
            let name = joined(scope, declared.name());
            if self.enums_by_name.contains_key(&name) {
                continue;
            }
            self.enums_by_name.insert(name, self.enums.len());
            let values = declared.value.iter().rev();
            let named = values.map(|value| (value.number(), value.name().to_owned()));
            // Of several names for a number, the first.
            self.enums.push(named.collect());
        }
    }

    fn declare(&mut self, scope: &str, message: &DescriptorProto) {
        let name = joined(scope, message.name());
        for nested in &message.nested_type {
            self.declare(&name, nested);
        }
        self.declare_enums(&name, &message.enum_type);
        if self.by_name.contains_key(&name) {
            return;
        }
        self.by_name.insert(name.clone(), self.messages.len());
        let options = message.options.as_ref();
        self.messages.push(MessageType {
            name,
            map_entry: options.is_some_and(|options| options.map_entry()),
            ..MessageType::default()
        });
    }

    fn fields_of_file(&mut self, file: &FileDescriptorProto) {
        let proto3 = file.syntax() == "proto3";
        for message in &file.message_type {
            self.fields(file.package(), message, proto3);
        }
        self.extensions(file.package(), &file.extension, proto3);
    }

    fn fields(&mut self, scope: &str, message: &DescriptorProto, proto3: bool) {
        let name = joined(scope, message.name());
        for nested in &message.nested_type {
            self.fields(&name, nested, proto3);
        }
        self.extensions(&name, &message.extension, proto3);
        let Some(at) = self.by_name.get(&name).copied() else {
            return;
        };
        if !self.done.insert(at) {
            return;
        }
        for field in &message.field {
            let read = self.field(&name, field, field.name().to_owned(), proto3);
            self.add(at, read);
        }
    }

    /// Extensions are fields of the messages that they extend, named in brackets.
    fn extensions(&mut self, scope: &str, fields: &[FieldDescriptorProto], proto3: bool) {
        for field in fields {
            if let Some(at) = self.resolve(scope, field.extendee()) {
                let name = format!("[{}]", joined(scope, field.name()));
                let read = self.field(scope, field, name, proto3);
                self.add(at, read);
            }
        }
    }

    fn add(&mut self, at: usize, field: Field) {
        let message = &mut self.messages[at];
        message
            .by_name
            .entry(field.name.clone())
            .or_insert(field.number);
        message.fields.entry(field.number).or_insert(field);
    }

    fn field(&self, scope: &str, from: &FieldDescriptorProto, name: String, proto3: bool) -> Field {
        let message = || self.resolve(scope, from.type_name());
        let declared = from.r#type.and_then(|kind| Type::try_from(kind).ok());
        let kind = match declared {
            Some(Type::Message | Type::Group) => FieldType::Message(message()),
            Some(kind) => FieldType::Scalar(kind),
            // A type name alone is a message or an enumeration.
            None => message().map_or(FieldType::Scalar(Type::Enum), |at| {
                FieldType::Message(Some(at))
            }),
        };
        let optional = from.proto3_optional();
        let names = match kind {
            FieldType::Scalar(Type::Enum) => resolve(&self.enums_by_name, scope, from.type_name()),
            _ => None,
        };
        Field {
            name,
            number: from.number() as u32,
            kind,
            repeated: from.label() == Label::Repeated,
            presence: !proto3
                || optional
                || from.oneof_index.is_some()
                || matches!(kind, FieldType::Message(_)),
            oneof: from.oneof_index.filter(|_| !optional),
            names,
        }
    }

    fn resolve(&self, scope: &str, name: &str) -> Option<usize> {
        resolve(&self.by_name, scope, name)
    }
}

/// A type by its name, seen from `scope`: with a leading dot the name is whole.
fn resolve(by_name: &BTreeMap<String, usize>, scope: &str, name: &str) -> Option<usize> {
    if let Some(whole) = name.strip_prefix('.') {
        return by_name.get(whole).copied();
    }
    let mut scope = scope;
    loop {
        if let Some(at) = by_name.get(&joined(scope, name)) {
            return Some(*at);
        }
        if scope.is_empty() {
            return None;
        }
        scope = scope.rsplit_once('.').map_or("", |(outer, _)| outer);
    }
}
