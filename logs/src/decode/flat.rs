//! FlatBuffers by reflection: the schema of a log is a FlatBuffer itself, which says where in a message each
//! field is.
//!
//! Read here, with every offset checked against the bytes, since messages may be anybody's. What a message unfolds
//! into is bounded, as tables may share their parts.

mod buffer;
#[cfg(test)]
mod tests;

use std::borrow::Cow;

use crate::value::{DEPTH, NumberKind, Numbers, Unreadable, VALUES, Value, within};
use buffer::{Buffer, Table};

/// The types of a schema, and which of them its messages are.
#[derive(Debug)]
pub(crate) struct FlatSchema {
    objects: Vec<Object>,
    enums: Vec<Enum>,
    root: usize,
}

/// A table or a struct.
#[derive(Debug)]
struct Object {
    fields: Vec<Field>,
    is_struct: bool,
    /// How many bytes a struct has.
    bytes: usize,
}

#[derive(Debug)]
struct Field {
    name: String,
    kind: Kind,
    /// Where it is: in a table's list of offsets, or in a struct.
    offset: usize,
    integer: i64,
    real: f64,
    /// Absent is something else than the default.
    optional: bool,
}

/// A field's type, as the schema has it.
#[derive(Clone, Copy, Debug)]
struct Kind {
    base: u8,
    element: u8,
    /// Which object or enumeration it is of.
    index: i32,
    /// How many elements an array in a struct has.
    length: usize,
}

#[derive(Debug)]
struct Enum {
    values: Vec<(i64, String)>,
    is_union: bool,
    /// Of a union, the object of each value.
    objects: Vec<(i64, i32)>,
}

/// Numbers of the schema's types.
mod base {
    pub(super) const UNION_TYPE: u8 = 1;
    pub(super) const STRING: u8 = 13;
    pub(super) const VECTOR: u8 = 14;
    pub(super) const OBJECT: u8 = 15;
    pub(super) const UNION: u8 = 16;
    pub(super) const ARRAY: u8 = 17;
}

fn number(base: u8) -> Option<NumberKind> {
    Some(match base {
        base::UNION_TYPE | 4 => NumberKind::U8,
        2 => NumberKind::Bool,
        3 => NumberKind::I8,
        5 => NumberKind::I16,
        6 => NumberKind::U16,
        7 => NumberKind::I32,
        8 => NumberKind::U32,
        9 => NumberKind::I64,
        10 => NumberKind::U64,
        11 => NumberKind::F32,
        12 => NumberKind::F64,
        _ => return None,
    })
}

impl FlatSchema {
    /// Reads a schema, and finds the table `name` in it, or else its root.
    ///
    /// # Errors
    /// If it is no schema, or has no such table.
    pub(crate) fn read(data: &[u8], name: &str) -> Result<FlatSchema, Unreadable> {
        read_schema(data, name).map_err(|error| {
            Unreadable::new(format!("the schema is no FlatBuffers reflection: {error}"))
        })
    }

    /// What a message says.
    ///
    /// # Errors
    /// If its bytes are not what the schema says.
    pub(crate) fn value<'a>(&'a self, data: &'a [u8]) -> Result<Value<'a>, Unreadable> {
        let buffer = Buffer::new(data);
        let root = buffer.follow(0)?;
        let mut reader = Reader {
            schema: self,
            buffer,
            values: 0,
            bytes: budget(data),
        };
        reader.object(self.root, root, 0)
    }

    /// Calls `each` with every field that messages have, as long as it says so.
    pub(crate) fn fields(&self, each: &mut dyn FnMut(&str) -> bool, depth: usize) {
        self.fields_of(self.root, &mut String::new(), each, depth);
    }

    fn fields_of(
        &self,
        at: usize,
        path: &mut String,
        each: &mut dyn FnMut(&str) -> bool,
        depth: usize,
    ) {
        let mut goes_on = depth > 0;
        for field in self
            .objects
            .get(at)
            .iter()
            .flat_map(|object| &object.fields)
        {
            within(path, &field.name, &mut |path| {
                goes_on = goes_on && each(path);
                let is_object =
                    field.kind.base == base::OBJECT || field.kind.element == base::OBJECT;
                let index = usize::try_from(field.kind.index).ok();
                if let Some(index) = index.filter(|_| is_object && goes_on) {
                    self.fields_of(index, path, each, depth - 1);
                }
            });
        }
    }
}

fn read_schema(data: &[u8], name: &str) -> Result<FlatSchema, Unreadable> {
    let buffer = Buffer::new(data);
    let schema = buffer.table(buffer.follow(0)?)?;
    let mut objects = Vec::new();
    let mut found = None;
    let mut left = budget(data);
    for table in schema.tables(0)? {
        let object = table?;
        spend(&mut left, 1)?;
        if object.text(0)? == name {
            found.get_or_insert(objects.len());
        }
        let mut fields = Vec::new();
        for field in object.tables(1)? {
            let field = read_field(&field?, &mut left)?;
            fields.push(field);
        }
        // Schemas list fields by name; messages have them by number.
        fields.sort_by_key(|field| field.offset);
        objects.push(Object {
            fields,
            is_struct: object.number(2, NumberKind::Bool)? != 0,
            bytes: usize::try_from(object.number(4, NumberKind::I32)?).unwrap_or(0),
        });
    }
    let mut enums = Vec::new();
    for declared in schema.tables(1)? {
        enums.push(read_enum(&declared?, &mut left)?);
    }
    let root = match (found, schema.child(4)?) {
        (Some(root), _) => root,
        (None, Some(table)) => {
            let name = table.text(0)?;
            let mut tables = schema.tables(0)?;
            let at = tables.position(|table| {
                table.is_ok_and(|table| table.text(0).is_ok_and(|known| known == name))
            });
            at.ok_or_else(|| Unreadable::new("its root is none of its tables"))?
        }
        (None, None) => return Err(Unreadable::new(format!("it has no table {name:?}"))),
    };
    Ok(FlatSchema {
        objects,
        enums,
        root,
    })
}

fn read_field(table: &Table<'_>, left: &mut usize) -> Result<Field, Unreadable> {
    let name = table.text(0)?;
    spend(left, 1 + name.len())?;
    let kind = table.child(1)?;
    let kind = kind.ok_or_else(|| Unreadable::new("a field without a type"))?;
    let small =
        |at, table: &Table<'_>| Ok::<_, Unreadable>(table.number(at, NumberKind::U8)? as u8);
    Ok(Field {
        name: name.to_owned(),
        kind: Kind {
            base: small(0, &kind)?,
            element: small(1, &kind)?,
            index: match kind.has(2) {
                true => kind.number(2, NumberKind::I32)? as i32,
                false => -1,
            },
            length: kind.number(3, NumberKind::U16)? as usize,
        },
        offset: table.number(3, NumberKind::U16)? as usize,
        integer: table.number(4, NumberKind::I64)? as i64,
        real: table.real(5)?,
        optional: table.number(11, NumberKind::Bool)? != 0,
    })
}

fn read_enum(table: &Table<'_>, left: &mut usize) -> Result<Enum, Unreadable> {
    let (mut values, mut objects) = (Vec::new(), Vec::new());
    for value in table.tables(1)? {
        let value = value?;
        let number = value.number(1, NumberKind::I64)? as i64;
        let name = value.text(0)?;
        spend(left, 1 + name.len())?;
        values.push((number, name.to_owned()));
        if let Some(kind) = value.child(3)?
            && kind.has(2)
        {
            objects.push((number, kind.number(2, NumberKind::I32)? as i32));
        }
    }
    Ok(Enum {
        values,
        is_union: table.number(2, NumberKind::Bool)? != 0,
        objects,
    })
}

struct Reader<'a> {
    schema: &'a FlatSchema,
    buffer: Buffer<'a>,
    values: usize,
    /// How many bytes texts and lists may still have: tables may share them.
    bytes: usize,
}

/// What a buffer may unfold into, in bytes.
fn budget(data: &[u8]) -> usize {
    data.len().saturating_mul(8).saturating_add(1 << 16)
}

/// Takes bytes off a budget.
fn spend(budget: &mut usize, bytes: usize) -> Result<(), Unreadable> {
    let left = budget.checked_sub(bytes);
    *budget = left.ok_or_else(|| Unreadable::new("it shares its parts too often"))?;
    Ok(())
}

impl<'a> Reader<'a> {
    fn count(&mut self, values: usize) -> Result<(), Unreadable> {
        self.values = self.values.saturating_add(values);
        match self.values > VALUES {
            true => Err(Unreadable::new(format!(
                "a message of more than {VALUES} values"
            ))),
            false => Ok(()),
        }
    }

    fn schema_object(&self, index: i32) -> Result<(usize, &'a Object), Unreadable> {
        let at = usize::try_from(index).ok();
        let found = at.and_then(|at| Some((at, self.schema.objects.get(at)?)));
        found.ok_or_else(|| Unreadable::new("a type that the schema does not declare"))
    }

    fn object(&mut self, at: usize, place: usize, depth: usize) -> Result<Value<'a>, Unreadable> {
        self.count(1)?;
        if depth > DEPTH {
            return Err(Unreadable::new("tables nested too deep"));
        }
        let object = &self.schema.objects[at];
        let mut fields = Vec::new();
        let table = match object.is_struct {
            true => None,
            false => Some(self.buffer.table(place)?),
        };
        for field in &object.fields {
            let value = match &table {
                None => Some(self.in_struct(field, place, depth)?),
                Some(table) => self.in_table(field, table, depth)?,
            };
            if let Some(value) = value {
                fields.push((Cow::Borrowed(field.name.as_str()), value));
            }
        }
        Ok(Value::Object(fields))
    }

    /// A number, by its name if it is of an enumeration.
    fn named(&self, kind: Kind, value: Value<'static>) -> Value<'a> {
        let names = usize::try_from(kind.index).ok();
        let names = names.and_then(|at| self.schema.enums.get(at));
        let is_number = |base: u8| number(base).is_some();
        match (&value, names) {
            (Value::Int(number), Some(names))
                if is_number(kind.base) || is_number(kind.element) =>
            {
                let known = names
                    .values
                    .iter()
                    .find(|(value, _)| i128::from(*value) == *number);
                match known {
                    None => value,
                    Some((_, name)) => Value::Enum {
                        number: *number,
                        name: Cow::Borrowed(name),
                    },
                }
            }
            _ => value,
        }
    }

    fn in_struct(
        &mut self,
        field: &'a Field,
        place: usize,
        depth: usize,
    ) -> Result<Value<'a>, Unreadable> {
        self.count(1)?;
        let at = place.saturating_add(field.offset);
        let kind = field.kind;
        if let Some(number) = number(kind.base) {
            let bytes = self.buffer.bytes(at, number.bytes())?;
            return Ok(self.named(kind, number.read(bytes, false)));
        }
        match kind.base {
            base::OBJECT => {
                let (index, object) = self.schema_object(kind.index)?;
                match object.is_struct {
                    true => self.object(index, at, depth + 1),
                    false => Err(Unreadable::new("a table within a struct")),
                }
            }
            base::ARRAY => self.elements(kind, at, kind.length, depth),
            other => Err(Unreadable::new(format!("type {other} within a struct"))),
        }
    }

    fn in_table(
        &mut self,
        field: &'a Field,
        table: &Table<'a>,
        depth: usize,
    ) -> Result<Option<Value<'a>>, Unreadable> {
        self.count(1)?;
        let kind = field.kind;
        let Some(at) = table.place(field.offset)? else {
            return Ok(self.absent(field));
        };
        if let Some(number) = number(kind.base) {
            let bytes = self.buffer.bytes(at, number.bytes())?;
            return Ok(Some(self.named(kind, number.read(bytes, false))));
        }
        Ok(Some(match kind.base {
            base::STRING => self.text(at)?,
            base::OBJECT => {
                let (index, object) = self.schema_object(kind.index)?;
                let place = if object.is_struct {
                    at
                } else {
                    self.buffer.follow(at)?
                };
                self.object(index, place, depth + 1)?
            }
            base::VECTOR => {
                let (start, count) = self.buffer.vector(at)?;
                self.elements(kind, start, count, depth)?
            }
            base::UNION => {
                // The number of the alternative is in the field in front of it.
                let which = match table.place(field.offset.saturating_sub(2))? {
                    Some(place) => self.buffer.bytes(place, 1)?[0],
                    None => 0,
                };
                return self.union(kind, i64::from(which), at, depth);
            }
            other => return Err(Unreadable::new(format!("type {other}, which is not read"))),
        }))
    }

    fn union(
        &mut self,
        kind: Kind,
        which: i64,
        at: usize,
        depth: usize,
    ) -> Result<Option<Value<'a>>, Unreadable> {
        let of = usize::try_from(kind.index).ok();
        let of = of.and_then(|at| self.schema.enums.get(at));
        let of = of.filter(|of| of.is_union);
        let object = of.and_then(|of| of.objects.iter().find(|(number, _)| *number == which));
        match object {
            Some((_, index)) if *index >= 0 => {
                let (index, _) = self.schema_object(*index)?;
                let place = self.buffer.follow(at)?;
                Ok(Some(self.object(index, place, depth + 1)?))
            }
            Some(_) => Ok(Some(self.text(at)?)),
            None => Ok(None),
        }
    }

    /// What stands for a field that a table has not.
    fn absent(&self, field: &Field) -> Option<Value<'a>> {
        let kind = number(field.kind.base).filter(|_| !field.optional)?;
        let value = match kind {
            NumberKind::F64 => Value::Float(field.real),
            NumberKind::F32 => Value::Single(field.real as f32),
            NumberKind::Bool => Value::Bool(field.integer != 0),
            NumberKind::U64 => Value::Int((field.integer as u64).into()),
            _ => Value::Int(field.integer.into()),
        };
        Some(self.named(field.kind, value))
    }

    fn elements(
        &mut self,
        kind: Kind,
        start: usize,
        count: usize,
        depth: usize,
    ) -> Result<Value<'a>, Unreadable> {
        let named = self
            .schema
            .enums
            .get(usize::try_from(kind.index).unwrap_or(usize::MAX));
        if let Some(number) = number(kind.element) {
            let bytes = self
                .buffer
                .bytes(start, count.saturating_mul(number.bytes()))?;
            spend(&mut self.bytes, bytes.len())?;
            let numbers = Numbers::new(number, false, bytes);
            if named.is_none() {
                return Ok(Value::Numbers(numbers));
            }
            self.count(count)?;
            let values = numbers.iter().map(|value| self.named(kind, value));
            return Ok(Value::List(values.collect()));
        }
        let (size, object) = match kind.element {
            base::STRING => (4, None),
            base::OBJECT => match self.schema_object(kind.index)? {
                (at, object) if object.is_struct => (object.bytes.max(1), Some((at, true))),
                (at, _) => (4, Some((at, false))),
            },
            other => {
                let what = format!("a list of type {other}, which is not read");
                return Err(Unreadable::new(what));
            }
        };
        // That all are there, before anything is made of them.
        self.buffer.bytes(start, count.saturating_mul(size))?;
        let mut values = Vec::new();
        for at in (0..count).map(|at| start + at * size) {
            values.push(match object {
                None => self.text(at)?,
                Some((index, true)) => self.object(index, at, depth + 1)?,
                Some((index, false)) => self.object(index, self.buffer.follow(at)?, depth + 1)?,
            });
        }
        Ok(Value::List(values))
    }

    fn text(&mut self, at: usize) -> Result<Value<'a>, Unreadable> {
        self.count(1)?;
        let (start, length) = self.buffer.vector(at)?;
        let bytes = self.buffer.bytes(start, length)?;
        spend(&mut self.bytes, length)?;
        Ok(match std::str::from_utf8(bytes) {
            Ok(text) => Value::from(text),
            Err(_) => Value::Bytes(Cow::Borrowed(bytes)),
        })
    }
}
