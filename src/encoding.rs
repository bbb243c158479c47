//! Message encoding: any serde type in, protobuf out, with a descriptor that others can read.
//!
//! A message type derives `Serialize` and `Deserialize` and nothing else. [`Schema::of`] traces
//! its shape once, by deserializing it from samples; the schema then encodes values in a single
//! pass, decodes them to equal values, and describes itself as a protobuf file, so that log viewers
//! and other languages read every field.
//!
//! ```
//! use farside::encoding::Schema;
//! use serde::{Deserialize, Serialize};
//!
//! #[derive(Serialize, Deserialize, PartialEq, Debug)]
//! enum Order {
//!     Stop,
//!     Drive { speed_m_s: f64, via: Vec<(i32, i32)> },
//! }
//!
//! let schema = Schema::of::<Order>()?;
//! let order = Order::Drive { speed_m_s: 0.5, via: vec![(1, 2), (3, 4)] };
//! let mut bytes = Vec::new();
//! schema.encode(&order, &mut bytes)?;
//! assert_eq!(schema.decode::<Order>(&bytes)?, order);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # What becomes what
//!
//! | serde | protobuf (proto3) |
//! |---|---|
//! | struct, tuple struct, tuple of mixed types | message; fields numbered in order from 1 |
//! | `bool`, `f32`, `f64` | `bool`, `float`, `double`; always written, also when zero |
//! | `i8` to `i32`, `i64` | `int32`, `int64`; always written |
//! | `u8` to `u32`, `u64` | `uint32`, `uint64`; always written |
//! | `char`, strings | `string` |
//! | `serialize_bytes` | `bytes` |
//! | `i128`, `u128` | `bytes`: 16, little-endian |
//! | enum without data | enum; values prefixed with its name, numbered from 0 |
//! | enum with data | message with a `oneof` |
//! | `Option` | `optional` |
//! | `Vec`, arrays, tuples of one type | `repeated`, packed where protobuf can |
//! | maps | `map` where the key allows it, else repeated entries; sorted by encoded key |
//! | `Option<Option<_>>`, `Vec<Vec<_>>` and the like | a helper message around the inner one |
//! | newtype structs | what they hold; the root, and one that contains itself, are messages |
//!
//! Every NaN is written as the same NaN. Recursive types work; values may nest up to 96 messages,
//! since common readers stop at 100.
//!
//! # What is refused
//!
//! Types with fields that would not come back (`skip`, `skip_serializing`, `skip_serializing_if` for
//! other values than the default). Types whose shape depends on the data (`flatten`, `untagged`, internally and adjacently tagged
//! enums), hash maps and hash sets, roots that are no struct or enum, and types whose `Serialize`
//! writes what their `Deserialize` does not read. [`Schema::of`] names the type and the reason.
//!
//! # What is not kept
//!
//! On the wire `None`, an empty collection and a field left out by `skip_serializing_if` are all
//! "absent". An `Option` or collection that is skipped for any *other* value would not come back.

mod decode;
mod descriptor;
mod encode;
mod error;
mod flat;
mod format;
mod lower;
mod names;
mod registry;
mod sampled;
mod samples;
mod schema;
mod symmetry;
mod trace;
mod wire;

#[cfg(test)]
mod tests;

pub use error::{DecodeError, EncodeError, SchemaError};
pub use schema::{PACKAGE, Schema};
