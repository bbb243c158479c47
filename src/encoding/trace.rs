//! Learns a type's shape by deserializing it from samples.
//!
//! One pass reads one value of the root type. Each pass takes enum variants that are not fully
//! known, and enters options and collections only while something inside is unknown; passes are
//! repeated until nothing is. What cannot be continued (a value of a type inside itself, a sample
//! that the type refused) ends the pass, and the next one knows better.

use std::any::{TypeId, type_name};
use std::fmt;

use serde::Serialize;
use serde::de::{self, DeserializeOwned, DeserializeSeed, IntoDeserializer, Visitor};

use super::error::SchemaError;
use super::format::{Body, Container, Fields, Format, Variant, merge};
use super::registry::{Halt, INFINITE, Registry, Slot};
use super::sampled::Sampled;
use super::samples::{Sample, mix};
use crate::guard::guarded;

mod access;

use access::{CollectionAccess, FieldAccess, Room, TupleAccess, VariantChoice};

/// More passes than any sensible type needs.
const MAX_PASSES: usize = 10_000;
/// So many values are kept to check that `Serialize` agrees.
const MAX_VALUES: usize = 256;

/// A type that is traced.
pub(super) struct Subject {
    pub(super) type_name: &'static str,
    pub(super) id: TypeId,
    /// Reads a value from samples.
    read: fn(Tracer<'_>) -> Result<Box<dyn Sampled>, Halt>,
}

impl Subject {
    pub(super) fn of<T: Serialize + DeserializeOwned + 'static>() -> Subject {
        Subject {
            type_name: type_name::<T>(),
            id: TypeId::of::<T>(),
            read: |tracer| Ok(Box::new(T::deserialize(tracer)?)),
        }
    }
}

/// The shape of a type, and values that were read on the way.
pub(super) struct Traced {
    pub(super) registry: Registry,
    pub(super) root: usize,
    pub(super) values: Vec<Box<dyn Sampled>>,
}

/// Traces a root type.
pub(super) fn trace(subject: &Subject) -> Result<Traced, SchemaError> {
    let mut registry = Registry::default();
    let mut root = Format::Unknown;
    let mut values = Vec::new();
    let mut idle = 0;
    for _ in 0..MAX_PASSES {
        if registry.begin_pass(&root) && !values.is_empty() {
            return match root {
                Format::Container(root) => Ok(Traced {
                    registry,
                    root,
                    values,
                }),
                other => Err(SchemaError::NotAContainer {
                    type_name: subject.type_name.to_owned(),
                    found: other.to_string(),
                }),
            };
        }
        let before = registry.progress;
        let tries = registry.tries(0);
        let read = (subject.read)(Tracer {
            registry: &mut registry,
            slot: &mut root,
            site: 0,
            tries,
            cheap: false,
        });
        match read {
            Ok(value) if values.len() < MAX_VALUES => values.push(value),
            Ok(_) | Err(Halt::Again | Halt::Fatal | Halt::Duplicate(_)) => {}
            Err(Halt::Refused(reason)) => {
                registry.refuse(0, reason);
            }
        }
        if let Some(error) = registry.fatal.take() {
            return Err(error);
        }
        // A pass may only have tried another variant: a few in a row may learn nothing.
        idle = if registry.progress == before {
            idle + 1
        } else {
            0
        };
        if idle > registry.containers.len() + 8 {
            break;
        }
    }
    Err(SchemaError::Infinite {
        type_name: subject.type_name.to_owned(),
    })
}

impl Traced {
    /// Values in which every option and collection that can hold something holds something, made of
    /// other samples each. Types that validate may refuse some.
    pub(super) fn filled(&mut self, subject: &Subject) -> Vec<Box<dyn Sampled>> {
        /// So many and two for each variant of the largest enum, and so many attempts for each.
        const VALUES: u32 = 6;
        const ATTEMPTS: u32 = 16;
        /// So much is filled in one value: types within types would fill without end.
        const FILLS: u32 = 64;
        let mut values = Vec::new();
        let variants = self.registry.containers.iter().map(Container::variants);
        let variants = variants.max().unwrap_or(0) as u32;
        for sample in 0..VALUES.max(2 * variants) {
            let read = (0..ATTEMPTS).find_map(|_| {
                let mut root = Format::Container(self.root);
                self.registry.trail.clear();
                self.registry.fatal = None;
                self.registry.fills = Some(FILLS);
                let tries = sample + self.registry.tries(0);
                let registry = &mut self.registry;
                let read = guarded(|| {
                    (subject.read)(Tracer {
                        registry,
                        slot: &mut root,
                        site: 0,
                        tries,
                        cheap: false,
                    })
                });
                read.ok()?.ok()
            });
            values.extend(read);
        }
        values
    }
}

impl fmt::Display for Halt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Halt::Again => f.write_str("this pass is over"),
            Halt::Refused(reason) => f.write_str(reason),
            Halt::Duplicate(field) => write!(f, "field `{field}` came twice"),
            Halt::Fatal => f.write_str("this type has no schema"),
        }
    }
}

impl std::error::Error for Halt {}

impl de::Error for Halt {
    fn custom<T: fmt::Display>(message: T) -> Self {
        Halt::Refused(message.to_string())
    }

    fn duplicate_field(field: &'static str) -> Self {
        Halt::Duplicate(field)
    }
}

/// Reads samples for one value, and notes its shape in `slot`.
pub(super) struct Tracer<'a> {
    registry: &'a mut Registry,
    slot: &'a mut Format,
    /// Identifies this place within the value.
    site: u64,
    /// How many samples were refused here or further out.
    tries: u32,
    /// Take the shortest way: nothing new is to be found here.
    cheap: bool,
}

impl<'a> Tracer<'a> {
    fn sample(&self) -> Sample {
        Sample {
            tries: self.tries,
            site: self.site,
        }
    }

    /// Notes the shape.
    fn note(&mut self, format: Format) -> Result<(), Halt> {
        match merge(self.slot, format) {
            Ok(any) => {
                self.registry.progress += u64::from(any);
                Ok(())
            }
            Err((old, new)) => Err(self.registry.conflict(&old, &new)),
        }
    }

    /// Passes on what a visitor made of a scalar.
    fn scalar<T>(
        mut self,
        format: Format,
        visit: impl FnOnce(Sample) -> Result<T, Halt>,
    ) -> Result<T, Halt> {
        self.note(format)?;
        visit(self.sample()).map_err(|halt| self.registry.halted(self.site, halt))
    }

    /// A tracer for a part of this value.
    fn part<'b>(
        registry: &'b mut Registry,
        slot: &'b mut Format,
        outer: (u64, u32, bool),
        step: u64,
    ) -> Tracer<'b> {
        let (site, tries, cheap) = outer;
        let site = mix(site, step);
        let tries = tries + registry.tries(site);
        Tracer {
            registry,
            slot,
            site,
            tries,
            cheap,
        }
    }

    /// A tracer for a field of a container, which is closed by [`Registry::close`] or
    /// [`Registry::close_halted`].
    fn field<'b>(
        registry: &'b mut Registry,
        format: &'b mut Format,
        context: (u64, u32, bool),
        slot: Slot,
    ) -> Tracer<'b> {
        registry.trail.push(slot);
        let step = slot.field as u64 + ((slot.variant.map_or(0, |at| at as u64 + 1)) << 32);
        Tracer::part(registry, format, context, step)
    }

    fn context(&self) -> (u64, u32, bool) {
        (self.site, self.tries, self.cheap)
    }

    /// How many elements of a collection to read.
    fn count(&self, inner: &[&Format]) -> usize {
        let buildable = inner
            .iter()
            .all(|format| self.registry.depth(format) < INFINITE);
        if self.registry.fills.is_some() {
            let fill = inner.iter().all(|format| self.registry.may_fill(format));
            return usize::from(fill && buildable);
        }
        if self.tries > 0 && buildable {
            return [0, 1, 2, 3][self.tries as usize % 4];
        }
        let unknown = inner
            .iter()
            .any(|format| !self.registry.is_complete(format));
        let enterable = inner
            .iter()
            .all(|format| self.registry.is_enterable(format));
        usize::from(!self.cheap && unknown && enterable)
    }

    /// Notes a container, and whether to take the shortest way inside.
    fn enter(
        &mut self,
        type_name: &'static str,
        name: &'static str,
        body: Body,
    ) -> Result<(usize, bool), Halt> {
        let id = self.registry.container(type_name, name, body)?;
        self.note(Format::Container(id))?;
        let cheap = self.cheap || self.registry.is_settled(id);
        if cheap && self.registry.depth(&Format::Container(id)) == INFINITE {
            return Err(Halt::Again);
        }
        Ok((id, cheap))
    }

    /// Notes an enum, and which of its variants to read.
    fn enter_enum(
        &mut self,
        type_name: &'static str,
        name: &'static str,
        variants: &'static [&'static str],
    ) -> Result<(usize, usize, bool), Halt> {
        // The tag of an adjacently tagged enum is read as an enum of its own, by a type that
        // only the derive macro can name.
        if type_name.ends_with("::__Field") {
            return Err(self.registry.unsupported(
                name,
                "an adjacently tagged enum (tag, content) has no fixed shape; use serde's \
                 default form of enum",
            ));
        }
        // Protobuf knows no such enum, and nothing could be read as a first value.
        if variants.is_empty() {
            let reason = "an enum without variants has no values; leave it out";
            return Err(self.registry.unsupported(name, reason));
        }
        let each = |name: &&'static str| Variant {
            name,
            visits: 0,
            fields: None,
        };
        let body = Body::Enum(variants.iter().map(each).collect());
        let (id, cheap) = self.enter(type_name, name, body)?;
        let chosen = self.registry.choose(id, cheap, self.tries)?;
        Ok((id, chosen, cheap))
    }

    fn fields(self, id: usize, variant: Option<usize>, cheap: bool) -> FieldAccess<'a> {
        FieldAccess::new(self.registry, id, variant, (self.site, self.tries, cheap))
    }

    fn refuse_any<T>(self, type_name: &str) -> Result<T, Halt> {
        Err(self.registry.unsupported(
            type_name,
            "it is read by looking at the data (untagged, internally tagged or flattened), which \
             gives it no fixed shape; use serde's default form of enum, or name the fields",
        ))
    }

    fn struct_like<V: Visitor<'static>>(
        self,
        id: usize,
        variant: Option<usize>,
        cheap: bool,
        visitor: V,
    ) -> Result<V::Value, Halt> {
        let mut access = self.fields(id, variant, cheap);
        match visitor.visit_map(&mut access) {
            Err(Halt::Duplicate(primary)) => Err(access.duplicate(primary)),
            Ok(value) if variant.is_none() => {
                access.refuse_hidden(Room::of::<V::Value>(), type_name::<V>())?;
                Ok(value)
            }
            other => other,
        }
    }
}

/// Reads a field of a container: notes what is learned even where the pass ends.
fn read_field<S: DeserializeSeed<'static>>(
    registry: &mut Registry,
    slot: Slot,
    context: (u64, u32, bool),
    seed: S,
) -> Result<S::Value, Halt> {
    let mut format = registry.format(slot);
    let tracer = Tracer::field(registry, &mut format, context, slot);
    let site = tracer.site;
    match seed.deserialize(tracer) {
        Ok(value) => registry.close(slot, format).map(|()| value),
        Err(halt) => Err(registry.close_halted(slot, format, site, halt)),
    }
}

/// Reads an element of a collection or tuple.
fn read_part<S: DeserializeSeed<'static>>(
    registry: &mut Registry,
    slot: &mut Format,
    context: (u64, u32, bool),
    step: u64,
    seed: S,
) -> Result<S::Value, Halt> {
    let tracer = Tracer::part(registry, slot, context, step);
    let site = tracer.site;
    seed.deserialize(tracer)
        .map_err(|halt| registry.halted(site, halt))
}

fn unknown(len: usize) -> Vec<Format> {
    vec![Format::Unknown; len]
}

/// One scalar method: the hint, its format, and what to visit.
macro_rules! scalars {
    ($($method:ident, $format:ident, $visit:ident, $sample:expr;)*) => {$(
        fn $method<V: Visitor<'static>>(self, visitor: V) -> Result<V::Value, Halt> {
            let sample: fn(Sample) -> _ = $sample;
            self.scalar(Format::$format, |at| visitor.$visit(sample(at)))
        }
    )*};
}

impl<'a> de::Deserializer<'static> for Tracer<'a> {
    type Error = Halt;

    fn is_human_readable(&self) -> bool {
        false
    }

    scalars! {
        deserialize_bool, Bool, visit_bool, |at| at.integer() % 2 == 1;
        deserialize_i8, I32, visit_i8, |at| at.integer() as i8;
        deserialize_i16, I32, visit_i16, |at| at.integer().into();
        deserialize_i32, I32, visit_i32, |at| at.integer().into();
        deserialize_i64, I64, visit_i64, |at| at.integer().into();
        deserialize_i128, I128, visit_i128, |at| at.integer().into();
        deserialize_u8, U32, visit_u8, |at| at.integer();
        deserialize_u16, U32, visit_u16, |at| at.integer().into();
        deserialize_u32, U32, visit_u32, |at| at.integer().into();
        deserialize_u64, U64, visit_u64, |at| at.integer().into();
        deserialize_u128, U128, visit_u128, |at| at.integer().into();
        deserialize_f32, F32, visit_f32, |at| at.real() as f32;
        deserialize_f64, F64, visit_f64, |at| at.real();
        deserialize_char, Char, visit_char, |at| at.char();
        deserialize_str, Str, visit_borrowed_str, |at| at.string();
        deserialize_string, Str, visit_string, |at| at.string().to_owned();
        deserialize_bytes, Bytes, visit_borrowed_bytes, |at| at.bytes();
        deserialize_byte_buf, Bytes, visit_byte_buf, |at| at.bytes().to_vec();
    }

    fn deserialize_any<V: Visitor<'static>>(self, _visitor: V) -> Result<V::Value, Halt> {
        self.refuse_any(type_name::<V::Value>())
    }

    fn deserialize_identifier<V: Visitor<'static>>(self, _visitor: V) -> Result<V::Value, Halt> {
        self.refuse_any(type_name::<V::Value>())
    }

    fn deserialize_ignored_any<V: Visitor<'static>>(self, visitor: V) -> Result<V::Value, Halt> {
        visitor.visit_unit()
    }

    fn deserialize_unit<V: Visitor<'static>>(self, visitor: V) -> Result<V::Value, Halt> {
        self.scalar(Format::Unit, |_| visitor.visit_unit())
    }

    fn deserialize_option<V: Visitor<'static>>(mut self, visitor: V) -> Result<V::Value, Halt> {
        self.note(Format::Option(Box::default()))?;
        let context = self.context();
        let Format::Option(inner) = &*self.slot else {
            return Err(Halt::Again);
        };
        if self.count(&[inner]).is_multiple_of(2) {
            return visitor.visit_none();
        }
        let Format::Option(inner) = self.slot else {
            return Err(Halt::Again);
        };
        self.registry.fill();
        visitor.visit_some(Tracer::part(self.registry, inner, context, 1))
    }

    fn deserialize_seq<V: Visitor<'static>>(mut self, visitor: V) -> Result<V::Value, Halt> {
        refuse_hashed(self.registry, type_name::<V::Value>())?;
        self.note(Format::Seq(Box::default()))?;
        let context = self.context();
        let Format::Seq(inner) = &*self.slot else {
            return Err(Halt::Again);
        };
        let left = self.count(&[inner]);
        let Format::Seq(inner) = self.slot else {
            return Err(Halt::Again);
        };
        let slots = std::slice::from_mut(&mut **inner);
        self.registry.fill();
        visitor.visit_seq(CollectionAccess::new(self.registry, slots, context, left))
    }

    fn deserialize_map<V: Visitor<'static>>(mut self, visitor: V) -> Result<V::Value, Halt> {
        refuse_hashed(self.registry, type_name::<V::Value>())?;
        self.note(Format::Map(Box::default(), Box::default()))?;
        let context = self.context();
        let Format::Map(key, value) = &*self.slot else {
            return Err(Halt::Again);
        };
        let left = self.count(&[key, value]);
        let Format::Map(key, value) = self.slot else {
            return Err(Halt::Again);
        };
        let mut slots = [std::mem::take(&mut **key), std::mem::take(&mut **value)];
        self.registry.fill();
        let access = CollectionAccess::new(self.registry, &mut slots, context, left);
        let flattened = type_name::<V::Value>();
        let read = visitor.visit_map(access.naming(flattened));
        [**key, **value] = slots;
        read
    }

    fn deserialize_tuple<V: Visitor<'static>>(
        mut self,
        len: usize,
        visitor: V,
    ) -> Result<V::Value, Halt> {
        self.note(Format::Tuple(unknown(len)))?;
        let context = self.context();
        let Format::Tuple(slots) = self.slot else {
            return Err(Halt::Again);
        };
        visitor.visit_seq(TupleAccess::new(self.registry, slots, context))
    }

    fn deserialize_unit_struct<V: Visitor<'static>>(
        mut self,
        name: &'static str,
        visitor: V,
    ) -> Result<V::Value, Halt> {
        self.enter(type_name::<V::Value>(), name, Body::Fields(Fields::Unit))?;
        visitor.visit_unit()
    }

    fn deserialize_newtype_struct<V: Visitor<'static>>(
        mut self,
        name: &'static str,
        visitor: V,
    ) -> Result<V::Value, Halt> {
        let body = Body::Fields(Fields::Newtype(unknown(1)));
        let (id, cheap) = self.enter(type_name::<V::Value>(), name, body)?;
        // The visitor takes a deserializer, not a seed: what was learned is handed back by hand.
        let slot = Slot {
            container: id,
            variant: None,
            field: 0,
        };
        let mut format = self.registry.format(slot);
        let context = (self.site, self.tries, cheap);
        let inner = Tracer::field(self.registry, &mut format, context, slot);
        let site = inner.site;
        match visitor.visit_newtype_struct(inner) {
            Ok(value) => self.registry.close(slot, format).map(|()| value),
            Err(halt) => Err(self.registry.close_halted(slot, format, site, halt)),
        }
    }

    fn deserialize_tuple_struct<V: Visitor<'static>>(
        mut self,
        name: &'static str,
        len: usize,
        visitor: V,
    ) -> Result<V::Value, Halt> {
        let body = Body::Fields(Fields::Tuple(unknown(len)));
        let (id, cheap) = self.enter(type_name::<V::Value>(), name, body)?;
        let mut access = self.fields(id, None, cheap);
        let value = visitor.visit_seq(&mut access)?;
        access.refuse_hidden(Room::of::<V::Value>(), type_name::<V>())?;
        Ok(value)
    }

    fn deserialize_struct<V: Visitor<'static>>(
        mut self,
        name: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Halt> {
        let body = Body::Fields(Fields::Struct(fields, unknown(fields.len())));
        let (id, cheap) = self.enter(type_name::<V::Value>(), name, body)?;
        self.struct_like(id, None, cheap, visitor)
    }

    fn deserialize_enum<V: Visitor<'static>>(
        mut self,
        name: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Halt> {
        let (id, chosen, cheap) = self.enter_enum(type_name::<V::Value>(), name, variants)?;
        visitor.visit_enum(VariantChoice {
            tracer: self,
            id,
            chosen,
            cheap,
        })
    }
}

/// Refuses collections whose order changes between runs.
fn refuse_hashed(registry: &mut Registry, name: &str) -> Result<(), Halt> {
    if name.starts_with("std::collections::hash::") || name.starts_with("hashbrown::") {
        let reason = "its order differs between runs; use BTreeMap, BTreeSet or a sorted Vec";
        return Err(registry.unsupported(name, reason));
    }
    Ok(())
}

/// Gives a field's or variant's name to whoever asks for it.
fn read_name<S: DeserializeSeed<'static>>(name: &'static str, seed: S) -> Result<S::Value, Halt> {
    seed.deserialize(IntoDeserializer::<Halt>::into_deserializer(name))
}
