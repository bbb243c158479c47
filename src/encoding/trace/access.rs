//! What the tracer hands to visitors: fields, elements, entries and variants.

use std::any::type_name;

use serde::de::{self, DeserializeSeed, Visitor};

use super::super::format::{Body, Fields, Format};
use super::super::registry::{Halt, Registry, Slot};
use super::{Tracer, read_field, read_name, read_part, unknown};

/// The fields of a struct, tuple struct or variant.
pub(super) struct FieldAccess<'a> {
    registry: &'a mut Registry,
    id: usize,
    variant: Option<usize>,
    context: (u64, u32, bool),
    /// Positions of the fields, in the order to read them.
    order: Vec<usize>,
    next: usize,
    layout: Layout,
}

/// A type, and the room that it takes in bytes.
#[derive(Clone, Copy)]
pub(super) struct Room {
    type_name: &'static str,
    size: usize,
    align: usize,
}

impl Room {
    pub(super) fn of<T>() -> Room {
        Room {
            type_name: type_name::<T>(),
            size: size_of::<T>(),
            align: align_of::<T>(),
        }
    }
}

/// The room that the fields read so far take, in bytes.
#[derive(Default)]
struct Layout {
    /// Without padding.
    sum: usize,
    /// In the order of declaration, as C lays them out.
    in_order: usize,
    align: usize,
}

impl Layout {
    fn add(&mut self, Room { size, align, .. }: Room) {
        self.sum += size;
        self.in_order = self.in_order.next_multiple_of(align) + size;
        self.align = self.align.max(align);
    }

    /// True if a `T` of these fields and no others would be smaller than it is. A field that lies
    /// in what would be padding without it is not found out.
    fn is_less_than(&self, Room { size, align, .. }: Room) -> bool {
        // Fields sorted by alignment need no padding but at the end.
        let found = self.sum.next_multiple_of(align);
        // A type that asks for a larger alignment itself says nothing by its size.
        align <= self.align.max(1) && found < size && self.in_order.next_multiple_of(align) < size
    }
}

impl<'a> FieldAccess<'a> {
    pub(super) fn new(
        registry: &'a mut Registry,
        id: usize,
        variant: Option<usize>,
        context: (u64, u32, bool),
    ) -> FieldAccess<'a> {
        let container = &registry.containers[id];
        let len = container
            .fields(variant)
            .map_or(0, |fields| fields.formats().len());
        let (first, aliases) = (&container.first, &container.aliases);
        let later = (0..len).filter(|at| !first.contains(at) && !aliases.contains(at));
        let order = first.iter().copied().chain(later).collect();
        FieldAccess {
            registry,
            id,
            variant,
            context,
            order,
            next: 0,
            layout: Layout::default(),
        }
    }

    /// Refuses a struct that has more than the fields that were read: `#[serde(skip)]` leaves no
    /// trace in what serde says of a type but its size. Derived `Deserialize` alone is held to it,
    /// which the name of its visitor tells: others may make anything of what they read.
    pub(super) fn refuse_hidden(&mut self, room: Room, visitor: &str) -> Result<(), Halt> {
        let derived = visitor.contains("::__Visitor");
        let all_read = self.next == self.order.len();
        if derived && all_read && self.layout.is_less_than(room) {
            let reason = "it has a field that `#[serde(skip)]` leaves out, which would not come \
                          back where a message is copied or read from a log; write it, or keep it \
                          out of the message";
            return Err(self.registry.unsupported(room.type_name, reason));
        }
        Ok(())
    }

    /// Learns from a field that was refused because it came before.
    pub(super) fn duplicate(self, primary: &'static str) -> Halt {
        let last = self.order[self.next.min(self.order.len() - 1)];
        if self.variant.is_some() {
            return self
                .registry
                .unsupported(primary, "aliases in a struct variant; drop them");
        }
        self.registry.alias(self.id, last, primary)
    }

    fn read<S: DeserializeSeed<'static>>(&mut self, seed: S) -> Result<S::Value, Halt> {
        let slot = self.advance(Room::of::<S::Value>());
        read_field(self.registry, slot, self.context, seed)
    }

    /// The next field, which takes so much room.
    fn advance(&mut self, room: Room) -> Slot {
        let field = self.order[self.next];
        self.next += 1;
        self.layout.add(room);
        Slot {
            container: self.id,
            variant: self.variant,
            field,
        }
    }

    /// The name of the next field, if one is left.
    fn next_name(&self) -> Option<&'static str> {
        let fields = self.registry.containers[self.id].fields(self.variant);
        match (fields, self.order.get(self.next)) {
            (Some(Fields::Struct(names, _)), Some(&at)) => Some(names[at]),
            _ => None,
        }
    }
}

impl de::MapAccess<'static> for &mut FieldAccess<'_> {
    type Error = Halt;

    fn next_key_seed<K: DeserializeSeed<'static>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, Halt> {
        let name = self.next_name();
        name.map(|name| read_name(name, seed)).transpose()
    }

    fn next_value_seed<S: DeserializeSeed<'static>>(&mut self, seed: S) -> Result<S::Value, Halt> {
        self.read(seed)
    }
}

impl de::SeqAccess<'static> for FieldAccess<'_> {
    type Error = Halt;

    fn next_element_seed<S: DeserializeSeed<'static>>(
        &mut self,
        seed: S,
    ) -> Result<Option<S::Value>, Halt> {
        if self.next == self.order.len() {
            Ok(None)
        } else {
            self.read(seed).map(Some)
        }
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.order.len() - self.next)
    }
}

/// The elements of a tuple, each with a shape of its own.
pub(super) struct TupleAccess<'a> {
    registry: &'a mut Registry,
    slots: &'a mut [Format],
    context: (u64, u32, bool),
    next: usize,
}

impl<'a> TupleAccess<'a> {
    pub(super) fn new(
        registry: &'a mut Registry,
        slots: &'a mut [Format],
        context: (u64, u32, bool),
    ) -> TupleAccess<'a> {
        TupleAccess {
            registry,
            slots,
            context,
            next: 0,
        }
    }
}

impl de::SeqAccess<'static> for TupleAccess<'_> {
    type Error = Halt;

    fn next_element_seed<S: DeserializeSeed<'static>>(
        &mut self,
        seed: S,
    ) -> Result<Option<S::Value>, Halt> {
        let Some(slot) = self.slots.get_mut(self.next) else {
            return Ok(None);
        };
        self.next += 1;
        read_part(self.registry, slot, self.context, self.next as u64, seed).map(Some)
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.slots.len() - self.next)
    }
}

/// A few elements of a sequence, or entries of a map, all of one shape.
pub(super) struct CollectionAccess<'a> {
    registry: &'a mut Registry,
    /// One slot for a sequence, two for a map.
    slots: &'a mut [Format],
    context: (u64, u32, bool),
    left: usize,
    step: u64,
    type_name: &'static str,
}

impl<'a> CollectionAccess<'a> {
    pub(super) fn new(
        registry: &'a mut Registry,
        slots: &'a mut [Format],
        context: (u64, u32, bool),
        left: usize,
    ) -> CollectionAccess<'a> {
        CollectionAccess {
            registry,
            slots,
            context,
            left,
            step: 0,
            type_name: "",
        }
    }

    /// Says what type is being read, for the error about flattened structs.
    pub(super) fn naming(mut self, type_name: &'static str) -> CollectionAccess<'a> {
        self.type_name = type_name;
        self
    }

    fn read<S: DeserializeSeed<'static>>(&mut self, at: usize, seed: S) -> Result<S::Value, Halt> {
        self.step += 1;
        read_part(
            self.registry,
            &mut self.slots[at],
            self.context,
            self.step,
            seed,
        )
    }
}

impl de::SeqAccess<'static> for CollectionAccess<'_> {
    type Error = Halt;

    fn next_element_seed<S: DeserializeSeed<'static>>(
        &mut self,
        seed: S,
    ) -> Result<Option<S::Value>, Halt> {
        if self.left == 0 {
            return Ok(None);
        }
        self.left -= 1;
        self.read(0, seed).map(Some)
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.left)
    }
}

impl de::MapAccess<'static> for CollectionAccess<'_> {
    type Error = Halt;

    fn next_key_seed<K: DeserializeSeed<'static>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, Halt> {
        // A flattened struct is read as a map, but its keys are names of fields. This is looked
        // at even where no entry is to be read, since such a struct would otherwise be mistaken
        // for an empty map.
        if type_name::<K::Value>().contains("::__Field") {
            let type_name = self.type_name;
            let reason = "`#[serde(flatten)]` gives it no fixed shape; name the fields instead";
            return Err(self.registry.unsupported(type_name, reason));
        }
        if self.left == 0 {
            return Ok(None);
        }
        self.left -= 1;
        self.read(0, seed).map(Some)
    }

    fn next_value_seed<S: DeserializeSeed<'static>>(&mut self, seed: S) -> Result<S::Value, Halt> {
        self.read(1, seed)
    }
}

/// The variant that the tracer chose.
pub(super) struct VariantChoice<'a> {
    pub(super) tracer: Tracer<'a>,
    pub(super) id: usize,
    pub(super) chosen: usize,
    pub(super) cheap: bool,
}

impl VariantChoice<'_> {
    fn set(&mut self, fields: Fields) -> Result<(), Halt> {
        self.tracer
            .registry
            .set_variant(self.id, self.chosen, fields)
    }
}

impl<'a> de::EnumAccess<'static> for VariantChoice<'a> {
    type Error = Halt;
    type Variant = VariantChoice<'a>;

    fn variant_seed<S: DeserializeSeed<'static>>(
        self,
        seed: S,
    ) -> Result<(S::Value, VariantChoice<'a>), Halt> {
        let Body::Enum(variants) = &self.tracer.registry.containers[self.id].body else {
            return Err(Halt::Again);
        };
        let name = variants[self.chosen].name;
        Ok((read_name(name, seed)?, self))
    }
}

impl de::VariantAccess<'static> for VariantChoice<'_> {
    type Error = Halt;

    fn unit_variant(mut self) -> Result<(), Halt> {
        self.set(Fields::Unit)
    }

    fn newtype_variant_seed<S: DeserializeSeed<'static>>(
        mut self,
        seed: S,
    ) -> Result<S::Value, Halt> {
        self.set(Fields::Newtype(unknown(1)))?;
        let slot = Slot {
            container: self.id,
            variant: Some(self.chosen),
            field: 0,
        };
        let context = (self.tracer.site, self.tracer.tries, self.cheap);
        read_field(self.tracer.registry, slot, context, seed)
    }

    fn tuple_variant<V: Visitor<'static>>(
        mut self,
        len: usize,
        visitor: V,
    ) -> Result<V::Value, Halt> {
        self.set(Fields::Tuple(unknown(len)))?;
        visitor.visit_seq(self.tracer.fields(self.id, Some(self.chosen), self.cheap))
    }

    fn struct_variant<V: Visitor<'static>>(
        mut self,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Halt> {
        self.set(Fields::Struct(fields, unknown(fields.len())))?;
        self.tracer
            .struct_like(self.id, Some(self.chosen), self.cheap, visitor)
    }
}
