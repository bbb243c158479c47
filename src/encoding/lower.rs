//! Decides how each traced shape looks in protobuf: fields, helper messages and names.

use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;

use super::flat::{
    Card, Enumeration, Field, FlatSchema, Key, Message, Scope, Shape, Value, ValueType,
};
use super::format::{Body, Container, Fields, Format};
use super::names::{Names, camel, identifier, snake};
use super::wire::{Tag, Wire};

/// Builds the flat schema for the container at `root`.
pub(super) fn lower(containers: &[Container], root: usize) -> FlatSchema {
    let mut lowering = Lowering {
        containers,
        newtype_messages: newtype_messages(containers, root),
        messages: Vec::new(),
        enums: Vec::new(),
        by_container: BTreeMap::new(),
        by_format: BTreeMap::new(),
        root_names: Names::default(),
        inner_names: Vec::new(),
        work: Vec::new(),
    };
    lowering.run(root);
    let Lowering {
        messages, enums, ..
    } = lowering;
    let place = messages[0].name.clone();
    let root = Field {
        tag: Tag::NONE,
        kind: ValueType::Message(0),
        first: ValueType::Message(0),
        card: Card::Single,
        packed: false,
        element: None,
        key: Key::new(""),
        required: AtomicBool::new(true),
        left_out: AtomicBool::new(false),
        name: place.clone(),
        place,
    };
    FlatSchema {
        messages,
        enums,
        root,
    }
}

/// For each container: is it a newtype struct that needs a message of its own? The root does, one
/// that contains itself does, and so does one around such a one.
fn newtype_messages(containers: &[Container], root: usize) -> Vec<bool> {
    let newtype = |id: usize| match &containers[id].body {
        Body::Fields(Fields::Newtype(inner)) => Some(&inner[0]),
        _ => None,
    };
    let mut needed: Vec<bool> = (0..containers.len())
        .map(|id| newtype(id).is_some() && (id == root || reaches(containers, id, id)))
        .collect();
    loop {
        let around = |id: usize| match newtype(id) {
            Some(Format::Container(inner)) => needed[*inner],
            _ => false,
        };
        let next: Vec<bool> = (0..needed.len())
            .map(|id| needed[id] || around(id))
            .collect();
        if next == needed {
            return needed;
        }
        needed = next;
    }
}

fn reaches(containers: &[Container], from: usize, target: usize) -> bool {
    let mut seen = vec![false; containers.len()];
    let mut work = vec![from];
    while let Some(id) = work.pop() {
        for fields in containers[id].all_fields() {
            let mut inner = Vec::new();
            fields
                .formats()
                .iter()
                .for_each(|format| collect(format, &mut inner));
            if inner.contains(&target) {
                return true;
            }
            inner.retain(|&id| !std::mem::replace(&mut seen[id], true));
            work.extend(inner);
        }
    }
    false
}

fn collect(format: &Format, into: &mut Vec<usize>) {
    match format {
        Format::Container(id) => into.push(*id),
        Format::Option(inner) | Format::Seq(inner) => collect(inner, into),
        Format::Map(key, value) => {
            collect(key, into);
            collect(value, into);
        }
        Format::Tuple(items) => items.iter().for_each(|item| collect(item, into)),
        _ => {}
    }
}

/// A field before it has a number: its serde name, its protobuf name, and its shape.
type Draft = (&'static str, String, Format);

struct Lowering<'a> {
    containers: &'a [Container],
    newtype_messages: Vec<bool>,
    messages: Vec<Message>,
    enums: Vec<Enumeration>,
    by_container: BTreeMap<usize, ValueType>,
    /// Helper messages, by what they stand for: shared wherever the same is needed.
    by_format: BTreeMap<Format, usize>,
    /// Names within the root, where every helper type lives.
    root_names: Names,
    /// Names within each other message.
    inner_names: Vec<Names>,
    /// Messages whose fields are still to be lowered.
    work: Vec<(usize, Vec<Draft>)>,
}

impl Lowering<'_> {
    fn run(&mut self, root: usize) {
        let containers = self.containers;
        let container = &containers[root];
        let name = identifier(container.name);
        if container.is_plain_enum() {
            let id = self.push(name, Scope::Top, Shape::Wrapper);
            self.work
                .push((id, vec![("", "value".to_owned(), Format::Container(root))]));
        } else {
            self.declare(root, Scope::Top);
        }
        // The first message's fields claim their names before any helper does.
        while !self.work.is_empty() {
            let (id, drafts) = self.work.remove(0);
            self.fill(id, drafts);
        }
    }

    fn push(&mut self, name: String, scope: Scope, shape: Shape) -> usize {
        self.messages.push(Message {
            withheld: AtomicBool::new(false),
            name,
            scope,
            shape,
            fields: Vec::new(),
        });
        self.inner_names.push(Names::default());
        self.messages.len() - 1
    }

    /// Adds a message inside the root.
    fn helper(&mut self, name: &str, shape: Shape, drafts: Vec<Draft>) -> usize {
        let name = self.root_names.take(name);
        let id = self.push(name, Scope::Root, shape);
        self.work.push((id, drafts));
        id
    }

    fn fill(&mut self, id: usize, drafts: Vec<Draft>) {
        if self.messages[id].shape == Shape::Oneof {
            self.names(id).take_folded("variant");
        }
        let named: Vec<Draft> = drafts
            .into_iter()
            .map(|(key, name, format)| (key, self.names(id).take_folded(&name), format))
            .collect();
        for (position, (key, name, format)) in named.into_iter().enumerate() {
            let oneof = self.messages[id].shape == Shape::Oneof;
            let (card, kind) = if oneof {
                (Card::Single, self.element(&format))
            } else {
                self.place(&format, id, &name)
            };
            let numeric = !matches!(kind.wire(), Wire::Bytes);
            let packed = card == Card::Repeated && numeric;
            let wire = if packed { Wire::Bytes } else { kind.wire() };
            let place = format!("{}.{name}", self.messages[id].name);
            let field = |tag, first, card, packed, element| Field {
                tag,
                kind,
                first,
                card,
                packed,
                element,
                key: Key::new(key),
                required: AtomicBool::new(false),
                left_out: AtomicBool::new(false),
                place: place.clone(),
                name: name.clone(),
            };
            let tag = Tag::new(position as u32 + 1, wire);
            let one = |tag| field(tag, kind, Card::Single, false, None);
            let field = match card {
                Card::Single => one(tag),
                Card::Map => field(tag, ValueType::Pending, card, packed, None),
                Card::Optional | Card::Repeated => {
                    let element = Box::new(one(if packed { Tag::NONE } else { tag }));
                    field(tag, ValueType::Pending, card, packed, Some(element))
                }
            };
            self.messages[id].fields.push(field);
        }
    }

    fn names(&mut self, id: usize) -> &mut Names {
        if id == 0 {
            &mut self.root_names
        } else {
            &mut self.inner_names[id]
        }
    }

    /// The format behind newtype structs that are replaced by what they hold.
    fn resolve<'f>(&'f self, format: &'f Format) -> &'f Format {
        let mut format = format;
        while let Format::Container(id) = format {
            // Variants' contents have numbers beyond the containers.
            match self.containers.get(*id).map(|container| &container.body) {
                Some(Body::Fields(Fields::Newtype(inner))) if !self.newtype_messages[*id] => {
                    format = &inner[0];
                }
                _ => break,
            }
        }
        format
    }

    /// The format with all such newtype structs replaced.
    fn resolved(&self, format: &Format) -> Format {
        match self.resolve(format) {
            Format::Option(inner) => Format::Option(Box::new(self.resolved(inner))),
            Format::Seq(inner) => Format::Seq(Box::new(self.resolved(inner))),
            Format::Map(key, value) => {
                Format::Map(Box::new(self.resolved(key)), Box::new(self.resolved(value)))
            }
            Format::Tuple(items) => {
                Format::Tuple(items.iter().map(|item| self.resolved(item)).collect())
            }
            other => other.clone(),
        }
    }

    /// How a field of this format looks in the message `owner`.
    fn place(&mut self, format: &Format, owner: usize, name: &str) -> (Card, ValueType) {
        match self.resolved(format) {
            Format::Option(inner) => (Card::Optional, self.element(&inner)),
            Format::Seq(inner) => (Card::Repeated, self.element(&inner)),
            Format::Tuple(items) if is_alike(&items) => (Card::Repeated, self.element(&items[0])),
            Format::Map(key, value) => {
                let entry = self.entry(&key, &value, owner, name);
                (Card::Map, ValueType::Message(entry))
            }
            other => (Card::Single, self.element(&other)),
        }
    }

    /// How one value of this format looks where neither repetition nor absence can be said.
    fn element(&mut self, format: &Format) -> ValueType {
        let format = self.resolved(format);
        match &format {
            Format::Bool => ValueType::Bool,
            Format::I32 => ValueType::I32,
            Format::I64 => ValueType::I64,
            Format::I128 => ValueType::I128,
            Format::U32 => ValueType::U32,
            Format::U64 => ValueType::U64,
            Format::U128 => ValueType::U128,
            Format::F32 => ValueType::F32,
            Format::F64 => ValueType::F64,
            Format::Char => ValueType::Char,
            Format::Str => ValueType::Str,
            Format::Bytes => ValueType::Bytes,
            Format::Container(id) => self.declare(*id, Scope::Root),
            _ => {
                if let Some(&id) = self.by_format.get(&format) {
                    return ValueType::Message(id);
                }
                let (shape, drafts) = match &format {
                    Format::Tuple(items) if !is_alike(items) => (Shape::Tuple, numbered(items)),
                    Format::Unit | Format::Unknown => (Shape::Unit, Vec::new()),
                    Format::Option(_) => (Shape::Wrapper, value_draft(&format, "value")),
                    _ => (Shape::Wrapper, value_draft(&format, "items")),
                };
                let id = self.helper(&self.describe(&format), shape, drafts);
                self.by_format.insert(format, id);
                ValueType::Message(id)
            }
        }
    }

    /// The message of a map's entries: a protobuf map where the key allows it.
    fn entry(&mut self, key: &Format, value: &Format, owner: usize, name: &str) -> usize {
        let drafts = vec![
            ("", "key".to_owned(), key.clone()),
            ("", "value".to_owned(), Format::clone(value)),
        ];
        let keyed = matches!(
            key,
            Format::Bool
                | Format::I32
                | Format::I64
                | Format::U32
                | Format::U64
                | Format::Str
                | Format::Char
        );
        let entry_name = format!("{}Entry", camel(name));
        if keyed && self.names(owner).take_exact(&entry_name) {
            let id = self.push(entry_name, Scope::MapEntry(owner), Shape::Entry);
            // The value of a protobuf map can be neither repeated nor optional.
            let kind = self.element(value);
            let plain = |key, name: &str, number, kind: ValueType| Field {
                tag: Tag::new(number, kind.wire()),
                kind,
                first: kind,
                card: Card::Single,
                packed: false,
                element: None,
                key: Key::new(key),
                required: AtomicBool::new(false),
                left_out: AtomicBool::new(false),
                name: name.to_owned(),
                place: format!("{}.{name}", self.messages[id].name),
            };
            let key = self.scalar(key);
            let fields = vec![plain("", "key", 1, key), plain("", "value", 2, kind)];
            self.messages[id].fields = fields;
            return id;
        }
        let wanted = format!("{}To{}Entry", self.describe(key), self.describe(value));
        self.helper(&short(wanted, "Entry"), Shape::Entry, drafts)
    }

    fn scalar(&self, format: &Format) -> ValueType {
        match format {
            Format::Bool => ValueType::Bool,
            Format::I32 => ValueType::I32,
            Format::I64 => ValueType::I64,
            Format::U32 => ValueType::U32,
            Format::U64 => ValueType::U64,
            Format::Char => ValueType::Char,
            _ => ValueType::Str,
        }
    }

    /// The message or enum of a container.
    fn declare(&mut self, id: usize, scope: Scope) -> ValueType {
        if let Some(&kind) = self.by_container.get(&id) {
            return kind;
        }
        let containers = self.containers;
        let container = &containers[id];
        let wanted = identifier(container.name);
        if container.is_plain_enum() {
            // Some languages forbid a type of its surrounding message's name.
            let same = self
                .messages
                .first()
                .is_some_and(|message| message.name == wanted);
            let wanted = if same {
                format!("{wanted}Value")
            } else {
                wanted
            };
            let kind = self.declare_enum(container, &wanted);
            self.by_container.insert(id, kind);
            return kind;
        }
        let name = match scope {
            Scope::Top => wanted,
            _ => self.root_names.take(&wanted),
        };
        let (shape, message) = match &container.body {
            Body::Fields(fields) => (shape_of(fields), self.push(name, scope, shape_of(fields))),
            Body::Enum(_) => (Shape::Oneof, self.push(name, scope, Shape::Oneof)),
        };
        self.by_container.insert(id, ValueType::Message(message));
        let drafts = match (&container.body, shape) {
            (Body::Fields(fields), _) => drafts(fields, &container.aliases),
            (Body::Enum(_), _) => self.variants(container, message),
        };
        self.work.push((message, drafts));
        ValueType::Message(message)
    }

    fn declare_enum(&mut self, container: &Container, wanted: &str) -> ValueType {
        let name = self.root_names.take(wanted);
        let prefix = snake(&name).to_uppercase();
        let Body::Enum(variants) = &container.body else {
            unreachable!("it is a plain enum")
        };
        let mut names = Names::default();
        let values = variants
            .iter()
            .map(|variant| {
                let value = format!("{prefix}_{}", snake(variant.name).to_uppercase());
                let value = names.take_folded(&value);
                Value {
                    key: Key::new(variant.name),
                    name: self.root_names.take(&value),
                }
            })
            .collect();
        self.enums.push(Enumeration { name, values });
        ValueType::Enum(self.enums.len() - 1)
    }

    /// The fields of a oneof: what a variant holds, or a message for its fields.
    fn variants(&mut self, container: &Container, message: usize) -> Vec<Draft> {
        let Body::Enum(variants) = &container.body else {
            return Vec::new();
        };
        let name = self.messages[message].name.clone();
        let mut all = Vec::new();
        for variant in variants {
            let format = match variant.fields.as_ref() {
                Some(Fields::Newtype(inner)) => inner[0].clone(),
                None | Some(Fields::Unit) => Format::Unit,
                Some(fields) => {
                    // A format of its own, so that variants of equal content keep their messages.
                    let wanted = format!("{name}{}", camel(&identifier(variant.name)));
                    let content = self.helper(&wanted, shape_of(fields), drafts(fields, &[]));
                    let marker = self.containers.len() + content;
                    self.by_container
                        .insert(marker, ValueType::Message(content));
                    Format::Container(marker)
                }
            };
            all.push((variant.name, snake(variant.name), format));
        }
        all
    }

    /// A name for a helper, from what it stands for.
    fn describe(&self, format: &Format) -> String {
        let name = match format {
            Format::Unit | Format::Unknown => "Unit".to_owned(),
            Format::Bool => "Bool".to_owned(),
            Format::I32 => "Int32".to_owned(),
            Format::I64 => "Int64".to_owned(),
            Format::I128 => "Int128".to_owned(),
            Format::U32 => "Uint32".to_owned(),
            Format::U64 => "Uint64".to_owned(),
            Format::U128 => "Uint128".to_owned(),
            Format::F32 => "Float".to_owned(),
            Format::F64 => "Double".to_owned(),
            Format::Char => "Char".to_owned(),
            Format::Str => "String".to_owned(),
            Format::Bytes => "Bytes".to_owned(),
            Format::Option(inner) => format!("Optional{}", self.describe(inner)),
            Format::Seq(inner) => format!("{}List", self.describe(inner)),
            Format::Tuple(items) if is_alike(items) => {
                format!("{}Array{}", self.describe(&items[0]), items.len())
            }
            Format::Tuple(items) => items
                .iter()
                .fold("Tuple".to_owned(), |name, item| name + &self.describe(item)),
            Format::Map(key, value) => {
                format!("{}To{}Map", self.describe(key), self.describe(value))
            }
            Format::Container(id) => match self.containers.get(*id) {
                Some(container) => camel(&identifier(container.name)),
                None => "Variant".to_owned(),
            },
        };
        short(name, "Value")
    }
}

/// Falls back to a short name where a telling one would not end.
fn short(name: String, fallback: &str) -> String {
    if name.len() > 60 {
        fallback.to_owned()
    } else {
        name
    }
}

/// Can a tuple be a repeated field?
fn is_alike(items: &[Format]) -> bool {
    items
        .first()
        .is_some_and(|first| items.iter().all(|item| item == first))
}

fn shape_of(fields: &Fields) -> Shape {
    match fields {
        Fields::Unit => Shape::Unit,
        Fields::Newtype(_) => Shape::Newtype,
        Fields::Tuple(_) => Shape::Tuple,
        Fields::Struct(..) => Shape::Struct,
    }
}

fn value_draft(format: &Format, name: &str) -> Vec<Draft> {
    vec![("", name.to_owned(), format.clone())]
}

fn numbered(formats: &[Format]) -> Vec<Draft> {
    let draft = |(at, format): (usize, &Format)| ("", format!("item_{at}"), format.clone());
    formats.iter().enumerate().map(draft).collect()
}

fn drafts(fields: &Fields, aliases: &[usize]) -> Vec<Draft> {
    match fields {
        Fields::Unit => Vec::new(),
        Fields::Newtype(inner) => value_draft(&inner[0], "value"),
        Fields::Tuple(formats) => numbered(formats),
        Fields::Struct(names, formats) => names
            .iter()
            .zip(formats)
            .enumerate()
            .filter(|(at, _)| !aliases.contains(at))
            .map(|(_, (name, format))| (*name, identifier(name), format.clone()))
            .collect(),
    }
}
