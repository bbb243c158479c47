//! Message definitions of ROS 1 and ROS 2, with those of all types that they use behind them.
//!
//! Read here, and not by a crate: one reader serves both versions, says the line of what is wrong, and its
//! types are those of `idl`.

use std::collections::BTreeMap;

use farside::suggest::{did_you_mean, nearest};

use super::structs::{Field, Struct, Structs, Type};
use crate::value::{NumberKind, Unreadable};

/// Whose definitions they are: the two differ in what their names for numbers mean.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Version {
    One,
    Two,
}

/// Reads the definition of a message and of the types behind it.
///
/// # Errors
/// With the line, if it is no definition, or a type is not there.
pub(crate) fn read(name: &str, text: &str, version: Version) -> Result<Structs, Unreadable> {
    let mut sections = vec![Section {
        name: short(name),
        lines: Vec::new(),
    }];
    let mut starts = false;
    for (at, line) in text.lines().enumerate() {
        let trimmed = line.trim();
        if trimmed.len() >= 10 && trimmed.bytes().all(|byte| byte == b'=') {
            starts = true;
        } else if let Some(name) = trimmed.strip_prefix("MSG:").filter(|_| starts) {
            sections.push(Section {
                name: short(name.trim()),
                lines: Vec::new(),
            });
            starts = false;
        } else if let Some(section) = sections.last_mut() {
            section.lines.push((at + 1, trimmed));
        }
    }
    let mut reader = Reader {
        version,
        names: BTreeMap::new(),
        structs: Vec::new(),
    };
    for section in &sections {
        reader.declare(&section.name);
    }
    if version == Version::Two {
        // What definitions may name without having it behind them.
        for name in ["builtin_interfaces/Time", "builtin_interfaces/Duration"] {
            if !reader.names.contains_key(name) {
                let at = reader.declare(name);
                reader.structs[at].fields = time_fields("sec", "nanosec", NumberKind::I32);
            }
        }
    }
    for section in &sections {
        reader.section(section)?;
    }
    Ok(Structs {
        structs: reader.structs,
        enums: Vec::new(),
        root: 0,
    })
}

/// A type's definition: its lines, with their numbers.
struct Section<'a> {
    name: String,
    lines: Vec<(usize, &'a str)>,
}

/// `pkg/msg/Type` is the same as `pkg/Type`.
fn short(name: &str) -> String {
    let mut parts = name.split('/');
    match (parts.next(), parts.next(), parts.next(), parts.next()) {
        (Some(package), Some("msg" | "srv" | "action"), Some(name), None) => {
            format!("{package}/{name}")
        }
        _ => name.to_owned(),
    }
}

fn time_fields(seconds: &str, nanos: &str, kind: NumberKind) -> Vec<Field> {
    let field = |name: &str, kind| Field {
        name: name.to_owned(),
        kind: Type::Number(kind),
    };
    let nanos_kind = match seconds {
        "secs" => kind,
        _ => NumberKind::U32,
    };
    vec![field(seconds, kind), field(nanos, nanos_kind)]
}

struct Reader {
    version: Version,
    names: BTreeMap<String, usize>,
    structs: Vec<Struct>,
}

impl Reader {
    fn declare(&mut self, name: &str) -> usize {
        if let Some(at) = self.names.get(name) {
            return *at;
        }
        self.names.insert(name.to_owned(), self.structs.len());
        self.structs.push(Struct {
            name: name.to_owned(),
            ..Struct::default()
        });
        self.structs.len() - 1
    }

    fn section(&mut self, section: &Section<'_>) -> Result<(), Unreadable> {
        let at = self.names[&section.name];
        let package = section.name.split_once('/').map_or("", |(name, _)| name);
        let mut fields = Vec::new();
        for (number, line) in &section.lines {
            let field = self.line(package, line);
            let named = |what: String| {
                let name = &section.name;
                Unreadable::new(format!("line {number} of the schema ({name}): {what}"))
            };
            fields.extend(field.map_err(named)?);
        }
        // A type that is there twice is the first.
        if self.structs[at].fields.is_empty() {
            self.structs[at].fields = fields;
        }
        Ok(())
    }

    /// A field; none for a constant, a comment or nothing.
    fn line(&mut self, package: &str, line: &str) -> Result<Option<Field>, String> {
        let line = line.split('#').next().unwrap_or_default().trim();
        let Some((kind, rest)) = line.split_once(char::is_whitespace) else {
            return match line {
                "" => Ok(None),
                line => Err(format!("expected a type and a name, found {line:?}")),
            };
        };
        let rest = rest.trim();
        let end = rest.find(|letter: char| !letter.is_alphanumeric() && letter != '_');
        let (name, behind) = rest.split_at(end.unwrap_or(rest.len()));
        if name.is_empty() || name.starts_with(|letter: char| letter.is_numeric()) {
            return Err(format!("expected a name behind {kind:?}, found {rest:?}"));
        }
        let behind = behind.trim_start();
        if behind.starts_with('=') {
            return Ok(None);
        }
        if !behind.is_empty() && self.version == Version::One {
            return Err(format!("expected the end of the line, found {behind:?}"));
        }
        Ok(Some(Field {
            name: name.to_owned(),
            kind: self.kind(package, kind)?,
        }))
    }

    /// A type as it is written: `float64`, `string<=10[]`, `Pose[3]`, `geometry_msgs/Point[<=5]`.
    fn kind(&mut self, package: &str, text: &str) -> Result<Type, String> {
        let (base, list) = match text.strip_suffix(']') {
            None => (text, None),
            Some(front) => {
                let (base, list) = front.rsplit_once('[').ok_or("a bracket too many")?;
                (base, Some(list))
            }
        };
        let kind = self.base(package, base)?;
        let number = |text: &str| {
            let count = text.parse::<u32>();
            count.map_err(|_| format!("expected a length of a list, found {text:?}"))
        };
        Ok(match list {
            None => kind,
            Some("") => Type::Sequence(Box::new(kind), None),
            Some(list) => match list.strip_prefix("<=") {
                Some(most) => Type::Sequence(Box::new(kind), Some(number(most)?)),
                None => Type::Array(Box::new(kind), number(list)?),
            },
        })
    }

    fn base(&mut self, package: &str, base: &str) -> Result<Type, String> {
        let (name, most) = match base.split_once("<=") {
            None => (base, None),
            Some((name, most)) => {
                let most = most.parse::<u32>();
                let wrong = |_| format!("expected a length of a text in {base:?}");
                (name, Some(most.map_err(wrong)?))
            }
        };
        match name {
            "string" => return Ok(Type::Text { most }),
            "wstring" => return Ok(Type::WideText { most }),
            _ if most.is_some() => return Err(format!("{name:?} has no length")),
            _ => {}
        }
        if let Some(kind) = self.number(name) {
            return Ok(Type::Number(kind));
        }
        match (name, self.version) {
            ("time" | "duration", Version::One) => {
                let kind = match name {
                    "time" => NumberKind::U32,
                    _ => NumberKind::I32,
                };
                let at = self.declare(name);
                self.structs[at].fields = time_fields("secs", "nsecs", kind);
                return Ok(Type::Struct(at));
            }
            ("time", Version::Two) => return Ok(self.known("builtin_interfaces/Time")),
            ("duration", Version::Two) => return Ok(self.known("builtin_interfaces/Duration")),
            _ => {}
        }
        let full = short(name);
        let own = format!("{package}/{name}");
        let header = "std_msgs/Header".to_owned();
        let names = match name {
            "Header" => [own, header, full],
            _ => [own, full.clone(), full],
        };
        let found = names.iter().find_map(|name| self.names.get(name));
        found.copied().map(Type::Struct).ok_or_else(|| {
            let close = nearest(name, self.names.keys().map(String::as_str));
            let hint = did_you_mean(close.as_deref());
            format!("the type {name:?} is not in the schema{hint}")
        })
    }

    fn known(&self, name: &str) -> Type {
        Type::Struct(self.names[name])
    }

    fn number(&self, name: &str) -> Option<NumberKind> {
        Some(match name {
            "bool" => NumberKind::Bool,
            "byte" if self.version == Version::One => NumberKind::I8,
            "byte" | "char" | "uint8" => NumberKind::U8,
            "int8" => NumberKind::I8,
            "int16" => NumberKind::I16,
            "uint16" => NumberKind::U16,
            "int32" => NumberKind::I32,
            "uint32" => NumberKind::U32,
            "int64" => NumberKind::I64,
            "uint64" => NumberKind::U64,
            "float32" => NumberKind::F32,
            "float64" => NumberKind::F64,
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(text: &str, version: Version) -> String {
        let structs = match read("pkg/msg/Root", text, version) {
            Ok(structs) => structs,
            Err(error) => return error.to_string(),
        };
        let root = &structs.structs[structs.root];
        let fields = root.fields.iter().map(|field| {
            let kind = field.kind.says(&structs);
            format!("{kind} {}", field.name)
        });
        fields.collect::<Vec<_>>().join(", ")
    }

    #[test]
    fn fields_constants_and_defaults_are_told_apart() {
        let text = "# a comment\n\nuint8 FIRST=1\nstring NAME = a # b\nint32 x 5\n\
            string<=10[<=4] names [\"a\", \"b\"]\nfloat64[36] covariance\nInner[] inner\n\
            other/msg/Inner one\nbuiltin_interfaces/Time stamp\nwstring w \"#\"\n\
            ================================================================================\n\
            MSG: pkg/Inner\nbool b\n\
            ================================================================================\n\
            MSG: other/Inner\nbyte c\n";
        let expected = "i32 x, string<=10[<=4] names, f64[36] covariance, pkg/Inner[] inner, \
            other/Inner one, builtin_interfaces/Time stamp, wstring w";
        assert_eq!(shown(text, Version::Two), expected);
    }

    #[test]
    fn what_is_wrong_is_told_with_its_line() {
        for (text, word) in [
            (
                "int32",
                "line 1 of the schema (pkg/Root): expected a type and a name",
            ),
            ("bool a\nint32 5", "line 2"),
            ("int33 x", "\"int33\" is not in the schema"),
            ("int32[x] y", "length of a list"),
            ("int32] y", "a bracket too many"),
            ("int32<=4 y", "has no length"),
            ("string<=-1 y", "length of a text"),
            ("int32[99999999999] y", "length of a list"),
        ] {
            let told = shown(text, Version::Two);
            assert!(told.contains(word), "{text}: {told}");
        }
        assert!(shown("int32 x 5", Version::One).contains("end of the line"));
    }

    #[test]
    fn the_first_version_has_times_of_its_own() {
        let text = "Header header\ntime t\nduration d\nbyte b\nchar c\n\
            ===========\nMSG: std_msgs/Header\nuint32 seq\n";
        let expected = "std_msgs/Header header, time t, duration d, i8 b, u8 c";
        assert_eq!(shown(text, Version::One), expected);
    }
}
