//! Types in OMG's interface definition language, as far as ROS 2 writes them: modules, structs, enums,
//! typedefs, constants, sequences, arrays and annotations.
//!
//! Read here: the crates for IDL that were found generate code, and do not read a schema while a program runs. Unions,
//! maps and bit sets are kept as what they are, and refused where a message holds one.

mod tokens;

use std::collections::BTreeMap;

use farside::suggest::{did_you_mean, nearest};

use super::structs::{Enumeration, Field, Struct, Structs, Type};
use crate::value::{NumberKind, Unreadable};
use tokens::{Token, Tokens};

/// How deep types within types may be declared.
const NESTED: usize = 32;

/// Reads definitions, and finds the struct `name` among them: `pkg/msg/Type` is `pkg::msg::Type`.
///
/// # Errors
/// With the line, if it is no IDL of this kind, or a type is not there.
pub(crate) fn read(name: &str, text: &str) -> Result<Structs, Unreadable> {
    let mut known = BTreeMap::new();
    let mut parser = Parser::new(text, known);
    for pass in 0.. {
        parser.definitions(0).map_err(|what| {
            let line = parser.tokens.line();
            Unreadable::new(format!("line {line} of the schema: {what}"))
        })?;
        match parser.unknown.take() {
            None => break,
            Some(unknown) if pass == PASSES => return Err(Unreadable::new(unknown)),
            Some(_) => {}
        }
        known = parser.names;
        parser = Parser::new(text, known);
    }
    let wanted = name.replace('/', "::");
    match parser.names.get(&wanted) {
        Some(Named::Struct(at)) => parser.out.root = *at,
        _ => {
            let close = nearest(&wanted, parser.names.keys().map(String::as_str));
            let hint = did_you_mean(close.as_deref());
            let what = format!("the schema declares no struct {wanted:?}{hint}");
            return Err(Unreadable::new(what));
        }
    }
    Ok(parser.out)
}

/// How often the text is read again for types that are declared behind where they are used, as the files
/// that a message needs come behind its own: once, and once more for each typedef of a typedef.
const PASSES: usize = 4;

/// What a name stands for.
#[derive(Clone, Debug)]
enum Named {
    Struct(usize),
    Enum(usize),
    Constant(i128),
    Alias(Type),
}

struct Parser<'a> {
    tokens: Tokens<'a>,
    scope: Vec<String>,
    names: BTreeMap<String, Named>,
    /// The names that were found when the text was read before.
    known: BTreeMap<String, Named>,
    out: Structs,
    /// The first type that is not declared, in words.
    unknown: Option<String>,
}

/// What annotations say about what follows them.
#[derive(Default)]
struct Annotations {
    mutable: bool,
    optional: bool,
    value: Option<i128>,
    narrow: bool,
}

impl<'a> Parser<'a> {
    fn new(text: &'a str, known: BTreeMap<String, Named>) -> Self {
        Parser {
            tokens: Tokens::new(text),
            scope: Vec::new(),
            names: BTreeMap::new(),
            known,
            out: Structs::default(),
            unknown: None,
        }
    }

    fn full(&self, name: &str) -> String {
        let mut full = self.scope.join("::");
        if !full.is_empty() {
            full.push_str("::");
        }
        full.push_str(name);
        full
    }

    /// Definitions up to the end of the text, or of a module.
    fn definitions(&mut self, depth: usize) -> Result<(), String> {
        if depth > NESTED {
            return Err("modules nested too deep".to_owned());
        }
        loop {
            let annotations = self.annotations()?;
            let word = match self.tokens.peek()? {
                None if depth == 0 => return Ok(()),
                None => return Err("a module that does not end".to_owned()),
                Some(Token::Sign("}")) if depth > 0 => return Ok(()),
                Some(Token::Sign(";")) => {
                    self.tokens.next()?;
                    continue;
                }
                _ => self.tokens.word("a definition")?,
            };
            match word {
                "module" => {
                    let name = self.tokens.word("the name of a module")?;
                    self.scope.push(name.to_owned());
                    self.tokens.expect("{")?;
                    self.definitions(depth + 1)?;
                    self.tokens.expect("}")?;
                    self.scope.pop();
                }
                "struct" => self.structure(&annotations)?,
                "enum" => self.enumeration(&annotations)?,
                "typedef" => self.alias()?,
                "const" => self.constant()?,
                "union" | "bitset" | "bitmask" | "interface" | "valuetype" | "map" => {
                    self.stranger(word)?;
                }
                other => return Err(format!("expected a definition, found {other:?}")),
            }
        }
    }

    /// What is declared and cannot be read: its name is kept, for where a message holds one.
    fn stranger(&mut self, what: &str) -> Result<(), String> {
        let name = self.tokens.word("a name")?.to_owned();
        while !self.tokens.is_at("{")? {
            if self.tokens.is_at(";")? {
                return Ok(());
            }
            let next = self.tokens.next()?;
            next.ok_or_else(|| format!("{name} is a {what} that does not end"))?;
        }
        self.tokens.skip_group()?;
        self.add_struct(
            &name,
            Vec::new(),
            Some(format!("{name} is a {what}, which is not read")),
        );
        Ok(())
    }

    fn add_struct(&mut self, name: &str, fields: Vec<Field>, refused: Option<String>) -> usize {
        let full = self.full(name);
        let at = self.out.structs.len();
        self.names.entry(full.clone()).or_insert(Named::Struct(at));
        self.out.structs.push(Struct {
            name: full.replace("::", "/"),
            fields,
            refused,
        });
        at
    }

    fn structure(&mut self, annotations: &Annotations) -> Result<(), String> {
        let name = self.tokens.word("the name of a struct")?.to_owned();
        if self.tokens.take(";")? {
            return Ok(());
        }
        let mut refused = annotations
            .mutable
            .then(|| format!("{name} is mutable, which is not read"));
        if self.tokens.take(":")? {
            let base = self.scoped()?;
            refused = Some(format!("{name} goes on from {base}, which is not read"));
        }
        self.tokens.expect("{")?;
        let at = self.add_struct(&name, Vec::new(), refused);
        let mut fields = Vec::new();
        while !self.tokens.take("}")? {
            let annotations = self.annotations()?;
            if annotations.optional {
                let what = format!("{name} has an optional field, which is not read");
                self.out.structs[at].refused.get_or_insert(what);
            }
            let kind = self.kind(0)?;
            loop {
                let (field, kind) = self.declarator(kind.clone())?;
                fields.push(Field { name: field, kind });
                if !self.tokens.take(",")? {
                    break;
                }
            }
            self.tokens.expect(";")?;
        }
        self.out.structs[at].fields = fields;
        Ok(())
    }

    fn enumeration(&mut self, annotations: &Annotations) -> Result<(), String> {
        let name = self.tokens.word("the name of an enum")?.to_owned();
        self.tokens.expect("{")?;
        let mut values = BTreeMap::new();
        let mut next = 0;
        while !self.tokens.take("}")? {
            let annotations = self.annotations()?;
            let literal = self.tokens.word("a name of an enum")?.to_owned();
            next = annotations.value.unwrap_or(next);
            if let Ok(number) = i64::try_from(next) {
                values.entry(number).or_insert_with(|| literal.clone());
            }
            let full = self.full(&literal);
            self.names.entry(full).or_insert(Named::Constant(next));
            next += 1;
            if !self.tokens.take(",")? {
                self.tokens.expect("}")?;
                break;
            }
        }
        if annotations.narrow {
            let what = format!("{name} is an enum of other than 32 bits, which is not read");
            self.add_struct(&name, Vec::new(), Some(what));
            return Ok(());
        }
        let full = self.full(&name);
        let at = self.out.enums.len();
        self.names.entry(full.clone()).or_insert(Named::Enum(at));
        let name = full.replace("::", "/");
        self.out.enums.push(Enumeration { name, values });
        Ok(())
    }

    fn alias(&mut self) -> Result<(), String> {
        let kind = self.kind(0)?;
        loop {
            let (name, kind) = self.declarator(kind.clone())?;
            let full = self.full(&name);
            self.names.entry(full).or_insert(Named::Alias(kind));
            if !self.tokens.take(",")? {
                break;
            }
        }
        Ok(())
    }

    fn constant(&mut self) -> Result<(), String> {
        self.kind(0)?;
        let name = self.tokens.word("the name of a constant")?.to_owned();
        self.tokens.expect("=")?;
        // Texts, numbers that are no integers and sums are no lengths of anything.
        let value = match self.tokens.peek()? {
            Some(Token::Word(_) | Token::Number(_)) => self.number().ok(),
            _ => None,
        };
        while !self.tokens.is_at(";")? {
            self.tokens.next()?.ok_or("a constant that does not end")?;
        }
        if let Some(value) = value {
            let full = self.full(&name);
            self.names.entry(full).or_insert(Named::Constant(value));
        }
        Ok(())
    }

    /// A name, with the lengths of an array behind it.
    fn declarator(&mut self, kind: Type) -> Result<(String, Type), String> {
        let name = self.tokens.word("a name")?.to_owned();
        let mut lengths = Vec::new();
        while self.tokens.take("[")? {
            lengths.push(self.length()?);
            self.tokens.expect("]")?;
            if lengths.len() > NESTED {
                return Err("an array of too many dimensions".to_owned());
            }
        }
        let array = |of, length: u32| Type::Array(Box::new(of), length);
        Ok((name, lengths.into_iter().rev().fold(kind, array)))
    }

    fn length(&mut self) -> Result<u32, String> {
        let number = self.number()?;
        u32::try_from(number).map_err(|_| format!("{number} is no length"))
    }

    /// An integer, or the name of one.
    fn number(&mut self) -> Result<i128, String> {
        match self.tokens.peek()? {
            Some(Token::Word(_)) => {
                let name = self.scoped()?;
                match self.find(&name) {
                    Some(Named::Constant(number)) => Ok(*number),
                    _ => Err(format!("{name:?} is no number")),
                }
            }
            Some(Token::Number(text)) => {
                self.tokens.next()?;
                let digits = match text.strip_prefix("0x").or(text.strip_prefix("0X")) {
                    Some(digits) => i128::from_str_radix(digits, 16),
                    None => text.parse(),
                };
                digits.map_err(|_| format!("expected an integer, found {text:?}"))
            }
            _ => Err("expected an integer".to_owned()),
        }
    }

    fn kind(&mut self, depth: usize) -> Result<Type, String> {
        if depth > NESTED {
            return Err("sequences nested too deep".to_owned());
        }
        let word = match self.tokens.is_at("::")? {
            true => "",
            false => self.tokens.word("a type")?,
        };
        Ok(Type::Number(match word {
            "sequence" => {
                self.tokens.expect("<")?;
                let of = Box::new(self.kind(depth + 1)?);
                let most = match self.tokens.take(",")? {
                    true => Some(self.length()?),
                    false => None,
                };
                self.tokens.expect(">")?;
                return Ok(Type::Sequence(of, most));
            }
            "string" => return Ok(Type::Text { most: self.most()? }),
            "wstring" => return Ok(Type::WideText { most: self.most()? }),
            "boolean" => NumberKind::Bool,
            "octet" | "uint8" | "char" => NumberKind::U8,
            "int8" => NumberKind::I8,
            "short" | "int16" => NumberKind::I16,
            "uint16" => NumberKind::U16,
            "int32" => NumberKind::I32,
            "uint32" => NumberKind::U32,
            "int64" => NumberKind::I64,
            "uint64" => NumberKind::U64,
            "float" => NumberKind::F32,
            "double" => NumberKind::F64,
            "long" => match self.tokens.peek()? {
                Some(Token::Word("double")) => return Err("long double is not read".to_owned()),
                _ => self.long(NumberKind::I32, NumberKind::I64)?,
            },
            "unsigned" => match self.tokens.word("a type")? {
                "short" => NumberKind::U16,
                "long" => self.long(NumberKind::U32, NumberKind::U64)?,
                other => return Err(format!("expected short or long, found {other:?}")),
            },
            "wchar" | "map" | "fixed" | "any" | "Object" => {
                return Err(format!("the type {word} is not read"));
            }
            word => {
                let name = self.scoped_from(word)?;
                return match self.find(&name) {
                    Some(Named::Struct(at)) => Ok(Type::Struct(*at)),
                    Some(Named::Enum(at)) => Ok(Type::Enum(*at)),
                    Some(Named::Alias(kind)) if levels(kind) + depth <= NESTED => Ok(kind.clone()),
                    Some(Named::Alias(_)) => Err("typedefs nested too deep".to_owned()),
                    Some(Named::Constant(_)) => Err(format!("{name:?} is no type")),
                    None => Ok(self.later(&name)),
                };
            }
        }))
    }

    /// A type that is declared further down, or nowhere.
    fn later(&mut self, name: &str) -> Type {
        if self.unknown.is_none() {
            let close = nearest(name, self.names.keys().map(String::as_str));
            let hint = did_you_mean(close.as_deref());
            let line = self.tokens.line();
            let what =
                format!("line {line} of the schema: the type {name:?} is not declared{hint}");
            self.unknown = Some(what);
        }
        Type::Struct(usize::MAX)
    }

    fn long(&mut self, one: NumberKind, two: NumberKind) -> Result<NumberKind, String> {
        match self.tokens.peek()? {
            Some(Token::Word("long")) => {
                self.tokens.next()?;
                Ok(two)
            }
            _ => Ok(one),
        }
    }

    fn most(&mut self) -> Result<Option<u32>, String> {
        if !self.tokens.take("<")? {
            return Ok(None);
        }
        let most = self.length()?;
        self.tokens.expect(">")?;
        Ok(Some(most))
    }

    fn scoped(&mut self) -> Result<String, String> {
        let word = match self.tokens.is_at("::")? {
            true => "",
            false => self.tokens.word("a name")?,
        };
        self.scoped_from(word)
    }

    fn scoped_from(&mut self, first: &str) -> Result<String, String> {
        let mut name = first.to_owned();
        while self.tokens.take("::")? {
            name.push_str("::");
            name.push_str(self.tokens.word("a name")?);
        }
        Ok(name)
    }

    /// What a name stands for here: in the innermost module that has it.
    fn find(&self, name: &str) -> Option<&Named> {
        if let Some(whole) = name.strip_prefix("::") {
            return self.names.get(whole).or_else(|| self.known.get(whole));
        }
        (0..=self.scope.len()).rev().find_map(|length| {
            let mut full = self.scope[..length].join("::");
            if length > 0 {
                full.push_str("::");
            }
            full.push_str(name);
            self.names.get(&full).or_else(|| self.known.get(&full))
        })
    }

    /// Annotations in front of a definition, and lines for a preprocessor.
    fn annotations(&mut self) -> Result<Annotations, String> {
        let mut found = Annotations::default();
        while self.tokens.take("@")? {
            let name = self.scoped()?;
            let mut text = String::new();
            let line = self.tokens.line();
            if self.tokens.is_at("(")? {
                text = self.tokens.skip_group()?;
            }
            let last = text.rsplit('=').next().unwrap_or_default().trim();
            match name.as_str() {
                "mutable" => found.mutable = true,
                "extensibility" if last.eq_ignore_ascii_case("mutable") => found.mutable = true,
                "optional" => found.optional = !last.eq_ignore_ascii_case("false"),
                "bit_bound" => found.narrow = last != "32",
                "value" => {
                    let number = last.parse::<i64>();
                    let wrong = |_| format!("expected an integer on line {line}, found {last:?}");
                    found.value = Some(number.map_err(wrong)?.into());
                }
                _ => {}
            }
        }
        Ok(found)
    }
}

/// How many lists a type is within lists.
fn levels(kind: &Type) -> usize {
    match kind {
        Type::Array(of, _) | Type::Sequence(of, _) => 1 + levels(of),
        _ => 0,
    }
}

#[cfg(test)]
mod tests;
