//! The schema of one message kind, as the rest of the world uses it.

use std::any::TypeId;
use std::collections::BTreeSet;
use std::sync::{Mutex, PoisonError};

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::error::{DecodeError, EncodeError, SchemaError};
use super::flat::FlatSchema;
use crate::guard::dropped;

use super::sampled::Sampled;
use super::trace::Subject;
use super::{decode, descriptor, encode, lower, symmetry, trace, wire};

/// The protobuf package of every message kind.
pub const PACKAGE: &str = "farside.msg";

/// How one message kind is written as protobuf: traced from its serde type.
///
/// A schema is immutable and made once for each kind; share it by [`Arc`](std::sync::Arc).
///
/// ```
/// use farside::encoding::Schema;
/// use serde::{Deserialize, Serialize};
///
/// #[derive(Serialize, Deserialize, PartialEq, Debug)]
/// struct Ping {
///     count: u32,
///     note: Option<String>,
/// }
///
/// let schema = Schema::of::<Ping>()?;
/// assert_eq!(schema.name(), "Ping");
/// assert_eq!(schema.full_name(), "farside.msg.Ping");
///
/// let mut bytes = Vec::new();
/// let ping = Ping { count: 7, note: None };
/// schema.encode(&ping, &mut bytes)?;
/// assert_eq!(bytes, [0x08, 7]);
/// assert_eq!(schema.decode::<Ping>(&bytes)?, ping);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Schema {
    name: &'static str,
    flat: FlatSchema,
}

impl Schema {
    /// Traces the type and decides its form in protobuf.
    ///
    /// ```
    /// use farside::encoding::{Schema, SchemaError};
    ///
    /// let error = Schema::of::<u32>().unwrap_err();
    /// assert!(matches!(error, SchemaError::NotAContainer { .. }));
    /// ```
    pub fn of<T: Serialize + DeserializeOwned + 'static>() -> Result<Schema, SchemaError> {
        Schema::tried(&Subject::of::<T>())
    }

    fn tried(subject: &Subject) -> Result<Schema, SchemaError> {
        let (schema, mut traced) = Schema::traced(subject)?;
        // A study builds the same simulation a thousand times.
        static CHECKED: Mutex<BTreeSet<TypeId>> = Mutex::new(BTreeSet::new());
        let checked = || CHECKED.lock().unwrap_or_else(PoisonError::into_inner);
        if !checked().contains(&subject.id) {
            let filled = traced.filled(subject);
            let symmetric =
                symmetry::check(subject.type_name, &schema.flat, &traced.values, &filled);
            drop_samples(traced.values.into_iter().chain(filled));
            symmetric?;
            checked().insert(subject.id);
        }
        Ok(schema)
    }

    /// The same, without trying whether values come back: for what starts no run, but goes through one again.
    pub(crate) fn untried<T: Serialize + DeserializeOwned + 'static>() -> Result<Schema, SchemaError>
    {
        let (schema, traced) = Schema::traced(&Subject::of::<T>())?;
        drop_samples(traced.values.into_iter());
        Ok(schema)
    }

    fn traced(subject: &Subject) -> Result<(Schema, trace::Traced), SchemaError> {
        let traced = trace::trace(subject)?;
        let schema = Schema {
            name: traced.registry.containers[traced.root].name,
            flat: lower::lower(&traced.registry.containers, traced.root),
        };
        Ok((schema, traced))
    }

    /// The message kind: the serde name of the type.
    pub fn name(&self) -> &str {
        self.name
    }

    /// The fully qualified protobuf name of the root message.
    pub fn full_name(&self) -> String {
        format!("{PACKAGE}.{}", self.flat.messages[0].name)
    }

    /// The name of the protobuf file that declares the root message, for another file to import.
    ///
    /// ```
    /// # use farside::encoding::Schema;
    /// #[derive(serde::Serialize, serde::Deserialize)]
    /// struct Ping(u32);
    ///
    /// assert_eq!(Schema::of::<Ping>()?.file_name(), "farside/msg/Ping.proto");
    /// # Ok::<(), farside::encoding::SchemaError>(())
    /// ```
    pub fn file_name(&self) -> String {
        format!(
            "{}/{}.proto",
            PACKAGE.replace('.', "/"),
            self.flat.messages[0].name
        )
    }

    /// The declaration as an encoded `google.protobuf.FileDescriptorProto`.
    ///
    /// Its first and only top-level message is the root; every type that it uses is nested inside
    /// it, so that the helper types of two kinds never collide.
    pub fn file_descriptor(&self) -> Vec<u8> {
        descriptor::file(&self.flat, &self.file_name(), PACKAGE)
    }

    /// The declaration as an encoded `google.protobuf.FileDescriptorSet` of that one file.
    ///
    /// A set is its files one after the other, so that appending another set adds its files.
    pub fn file_descriptor_set(&self) -> Vec<u8> {
        let mut out = Vec::new();
        let tag = wire::Tag::new(1, wire::Wire::Bytes);
        wire::put_bytes(&mut out, tag, &self.file_descriptor());
        out
    }

    /// Appends the value to `out`; on an error `out` is as it was.
    #[inline]
    pub fn encode<T: Serialize + ?Sized>(
        &self,
        value: &T,
        out: &mut Vec<u8>,
    ) -> Result<(), EncodeError> {
        encode::encode(&self.flat, value, out)
    }

    /// Reads a value. Unknown fields are skipped; a field that is absent reads as its serde
    /// default, or as protobuf's zero where the type has none.
    pub fn decode<T: DeserializeOwned>(&self, bytes: &[u8]) -> Result<T, DecodeError> {
        decode::decode(&self.flat, bytes)
    }
}

fn drop_samples(samples: impl Iterator<Item = Box<dyn Sampled>>) {
    for sample in samples {
        // What panics with a sample need not with what a run has.
        let _ = dropped(sample);
    }
}
