//! What can go wrong with a message type, a value or bytes.

use thiserror::Error;

/// Why a type has no message schema.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum SchemaError {
    /// The root is a scalar, a collection or the like: a message kind needs a container's name.
    #[error("`{type_name}` is {found}: a message must be a struct or an enum, wrap it in one")]
    NotAContainer {
        /// The Rust type.
        type_name: String,
        /// What was found instead of a container.
        found: String,
    },
    /// The type uses a form of serde that has no fixed shape.
    #[error("`{type_name}` at `{place}`: {reason}")]
    Unsupported {
        /// The Rust type, or the container that holds it where serde hides its name.
        type_name: String,
        /// Where in the message it was met, as in `Plan.steps`.
        place: String,
        /// Which form, and what to do instead.
        reason: String,
    },
    /// Two reads of one type disagree about its shape.
    #[error("`{place}` is read first as {expected}, then as {actual}")]
    Conflict {
        /// Where in the message it was met.
        place: String,
        /// The shape of the first read.
        expected: String,
        /// The shape of a later read.
        actual: String,
    },
    /// The type's `Deserialize` refused every sample value.
    #[error("`{place}` refused all {tries} sample values, the last one with: {reason}")]
    Refused {
        /// Where in the message it was met.
        place: String,
        /// How many were tried.
        tries: u32,
        /// What it said about the last one.
        reason: String,
    },
    /// No finite value of the type could be built: it always holds itself, or it has no variants.
    #[error("no finite value of `{type_name}` could be built: does it always contain itself?")]
    Infinite {
        /// The Rust type.
        type_name: String,
    },
    /// `Serialize` does not write what `Deserialize` reads.
    #[error("`Serialize` and `Deserialize` of `{type_name}` disagree: {reason}")]
    Asymmetric {
        /// The Rust type.
        type_name: String,
        /// The first difference.
        reason: String,
    },
}

/// Why a value could not be encoded.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum EncodeError {
    /// `Serialize` wrote something else than `Deserialize` reads.
    #[error("`{place}`: expected {expected}, but `Serialize` wrote {actual}")]
    Mismatch {
        /// Where in the message.
        place: String,
        /// What the schema says.
        expected: String,
        /// What was written.
        actual: String,
    },
    /// `Serialize` wrote a field that `Deserialize` never reads.
    #[error(
        "`{message}` has no field `{field}`: `Serialize` writes it, `Deserialize` never reads it"
    )]
    UnknownField {
        /// The message.
        message: String,
        /// The field's serde name.
        field: String,
    },
    /// `Serialize` wrote a variant that `Deserialize` never reads.
    #[error("`{name}` has no variant `{variant}` to read")]
    UnknownVariant {
        /// The enum.
        name: String,
        /// The variant's serde name.
        variant: String,
    },
    /// Messages are nested deeper than readers accept.
    #[error("nested deeper than {limit} messages")]
    TooDeep {
        /// The deepest nesting allowed.
        limit: u32,
    },
    /// The type's own `Serialize` failed.
    #[error("{0}")]
    Custom(String),
}

/// Why bytes could not be decoded.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum DecodeError {
    /// The bytes are no protobuf.
    #[error("`{message}` at byte {position}: {reason}")]
    Malformed {
        /// The message being read.
        message: String,
        /// The offset within that message.
        position: usize,
        /// What is wrong.
        reason: String,
    },
    /// A field has another type on the wire.
    #[error("`{place}`: expected {expected}, found {actual}")]
    WireType {
        /// The field.
        place: String,
        /// What the schema says.
        expected: String,
        /// What the bytes hold.
        actual: String,
    },
    /// An enum has a number that no variant has.
    #[error("`{name}` has no variant {number}, only 0 to {last}")]
    UnknownVariant {
        /// The enum.
        name: String,
        /// The number found.
        number: u64,
        /// The greatest number known.
        last: usize,
    },
    /// A data enum has no variant set that is known here.
    #[error("`{name}` has no variant set")]
    NoVariant {
        /// The enum.
        name: String,
    },
    /// Messages are nested deeper than this reader accepts.
    #[error("nested deeper than {limit} messages")]
    TooDeep {
        /// The deepest nesting allowed.
        limit: u32,
    },
    /// The type asks for another shape than the schema has: it is not the schema's type.
    #[error("`{place}`: the schema has {expected}, the type asks for {actual}")]
    Mismatch {
        /// Where in the message.
        place: String,
        /// What the schema says.
        expected: String,
        /// What `Deserialize` asked for.
        actual: String,
    },
    /// The type's own `Deserialize` refused the value.
    #[error("`{message}`: {reason}")]
    Custom {
        /// The root message.
        message: String,
        /// What it said.
        reason: String,
    },
}
