//! What tracing and checking ask of a type, behind pointers: the rest of them is compiled once, and
//! not once for each message kind.

use std::any::{TypeId, type_name};

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::error::{DecodeError, EncodeError};
use super::flat::FlatSchema;
use super::registry::Halt;
use super::trace::Tracer;
use super::{decode, encode};

/// A type that is traced.
pub(super) struct Subject {
    pub(super) type_name: &'static str,
    pub(super) id: TypeId,
    /// Reads a value from samples.
    pub(super) read: fn(Tracer<'_>) -> Result<Box<dyn Value>, Halt>,
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

/// A value of a traced type.
pub(super) trait Value {
    /// Appends the value to `out`, and notes which fields its `Serialize` leaves out.
    fn encode_noting(&self, flat: &FlatSchema, out: &mut Vec<u8>) -> Result<(), EncodeError>;

    /// Reads another value of this one's type.
    fn decode_another(
        &self,
        flat: &FlatSchema,
        bytes: &[u8],
    ) -> Result<Box<dyn Value>, DecodeError>;
}

impl<T: Serialize + DeserializeOwned + 'static> Value for T {
    fn encode_noting(&self, flat: &FlatSchema, out: &mut Vec<u8>) -> Result<(), EncodeError> {
        encode::encode_noting(flat, self, out)
    }

    fn decode_another(
        &self,
        flat: &FlatSchema,
        bytes: &[u8],
    ) -> Result<Box<dyn Value>, DecodeError> {
        Ok(Box::new(decode::decode::<T>(flat, bytes)?))
    }
}
