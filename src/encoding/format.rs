//! Shapes of types as the tracer learns them, before anything is decided about protobuf.

use std::fmt;

/// The shape of one value.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Format {
    /// Not met yet.
    #[default]
    Unknown,
    Unit,
    Bool,
    I32,
    I64,
    I128,
    U32,
    U64,
    U128,
    F32,
    F64,
    Char,
    Str,
    Bytes,
    Option(Box<Format>),
    Seq(Box<Format>),
    Tuple(Vec<Format>),
    Map(Box<Format>, Box<Format>),
    /// A struct or enum, by its index among the containers.
    Container(usize),
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Format::Option(inner) => write!(f, "an option of {inner}"),
            Format::Seq(inner) => write!(f, "a sequence of {inner}"),
            Format::Tuple(inner) => write!(f, "a tuple of {}", inner.len()),
            Format::Map(..) => f.write_str("a map"),
            Format::Container(_) => f.write_str("a struct or enum"),
            Format::Str => f.write_str("a string"),
            scalar => f.write_str(&format!("{scalar:?}").to_lowercase()),
        }
    }
}

/// The content of a struct or of a variant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Fields {
    Unit,
    Newtype(Vec<Format>),
    Tuple(Vec<Format>),
    Struct(&'static [&'static str], Vec<Format>),
}

impl Fields {
    pub(super) fn formats(&self) -> &[Format] {
        match self {
            Fields::Unit => &[],
            Fields::Newtype(formats) | Fields::Tuple(formats) | Fields::Struct(_, formats) => {
                formats
            }
        }
    }

    pub(super) fn formats_mut(&mut self) -> &mut [Format] {
        match self {
            Fields::Unit => &mut [],
            Fields::Newtype(formats) | Fields::Tuple(formats) | Fields::Struct(_, formats) => {
                formats
            }
        }
    }

    /// Is the other the same but for what is known of the fields?
    pub(super) fn alike(&self, other: &Fields) -> bool {
        match (self, other) {
            (Fields::Struct(a, _), Fields::Struct(b, _)) => a == b,
            _ => {
                std::mem::discriminant(self) == std::mem::discriminant(other)
                    && self.formats().len() == other.formats().len()
            }
        }
    }
}

impl fmt::Display for Fields {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Fields::Unit => f.write_str("a unit"),
            Fields::Newtype(_) => f.write_str("a newtype"),
            Fields::Tuple(formats) => write!(f, "a tuple of {}", formats.len()),
            Fields::Struct(names, _) => write!(f, "a struct of {}", names.join(", ")),
        }
    }
}

/// One variant of an enum.
#[derive(Clone, Debug)]
pub(super) struct Variant {
    pub(super) name: &'static str,
    /// How often the tracer chose it.
    pub(super) visits: u32,
    /// `None` until it was read once.
    pub(super) fields: Option<Fields>,
}

/// A struct or enum.
#[derive(Clone, Debug)]
pub(super) struct Container {
    pub(super) name: &'static str,
    pub(super) body: Body,
    /// Positions of names that are aliases of other fields.
    pub(super) aliases: Vec<usize>,
    /// Positions of fields that must be read first, because an alias would claim their place.
    pub(super) first: Vec<usize>,
}

/// What a container holds.
#[derive(Clone, Debug)]
pub(super) enum Body {
    Fields(Fields),
    Enum(Vec<Variant>),
}

impl Container {
    /// The content of a struct, or of a variant once it is known.
    pub(super) fn fields(&self, variant: Option<usize>) -> Option<&Fields> {
        match (&self.body, variant) {
            (Body::Fields(fields), None) => Some(fields),
            (Body::Enum(variants), Some(index)) => variants.get(index)?.fields.as_ref(),
            _ => None,
        }
    }

    /// Every content known so far.
    pub(super) fn all_fields(&self) -> Vec<&Fields> {
        match &self.body {
            Body::Fields(fields) => vec![fields],
            Body::Enum(variants) => variants.iter().filter_map(|v| v.fields.as_ref()).collect(),
        }
    }

    /// How many variants hold something.
    pub(super) fn variants(&self) -> usize {
        match &self.body {
            Body::Fields(_) => 0,
            Body::Enum(variants) => {
                let hold = |v: &&Variant| !matches!(v.fields, Some(Fields::Unit));
                variants.iter().filter(hold).count()
            }
        }
    }

    /// Is it an enum whose variants all hold nothing?
    pub(super) fn is_plain_enum(&self) -> bool {
        match &self.body {
            Body::Fields(_) => false,
            Body::Enum(variants) => variants
                .iter()
                .all(|variant| matches!(variant.fields, Some(Fields::Unit))),
        }
    }
}

/// Adds what `new` knows to `old`: whether that was anything, or the two shapes that disagree.
pub(super) fn merge(old: &mut Format, new: Format) -> Result<bool, (Format, Format)> {
    match (old, new) {
        (_, Format::Unknown) => Ok(false),
        (old @ Format::Unknown, new) => {
            *old = new;
            Ok(true)
        }
        (Format::Option(old), Format::Option(new)) | (Format::Seq(old), Format::Seq(new)) => {
            merge(old, *new)
        }
        (Format::Map(old_key, old_value), Format::Map(key, value)) => {
            Ok(merge(old_key, *key)? | merge(old_value, *value)?)
        }
        (Format::Tuple(old), Format::Tuple(new)) if old.len() == new.len() => {
            let mut any = false;
            for (old, new) in old.iter_mut().zip(new) {
                any |= merge(old, new)?;
            }
            Ok(any)
        }
        (old, new) if *old == new => Ok(false),
        (old, new) => Err((old.clone(), new)),
    }
}
