//! A value of a traced type, behind a pointer: what is done with samples is compiled once, and not
//! once for each message kind.

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::error::{DecodeError, EncodeError};
use super::flat::FlatSchema;
use super::{decode, encode};

/// A value that was read from samples.
pub(super) trait Sampled {
    /// Appends the value to `out`, and notes which fields its `Serialize` leaves out.
    fn encode_noting(&self, flat: &FlatSchema, out: &mut Vec<u8>) -> Result<(), EncodeError>;

    /// Reads another value of this one's type.
    fn decode_another(
        &self,
        flat: &FlatSchema,
        bytes: &[u8],
    ) -> Result<Box<dyn Sampled>, DecodeError>;
}

impl<T: Serialize + DeserializeOwned + 'static> Sampled for T {
    fn encode_noting(&self, flat: &FlatSchema, out: &mut Vec<u8>) -> Result<(), EncodeError> {
        encode::encode_noting(flat, self, out)
    }

    fn decode_another(
        &self,
        flat: &FlatSchema,
        bytes: &[u8],
    ) -> Result<Box<dyn Sampled>, DecodeError> {
        Ok(Box::new(decode::decode::<T>(flat, bytes)?))
    }
}
