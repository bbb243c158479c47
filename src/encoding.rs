//! Message encoding. For the moment bodies are JSON, so that the kernel can be built against the
//! interface that the protobuf encoding will fill.

use serde::Serialize;
use serde::de::DeserializeOwned;
use thiserror::Error;

/// A type that cannot be described.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct SchemaError(pub String);
/// A value that cannot be written.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct EncodeError(pub String);
/// Bytes that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct DecodeError(pub String);

/// How one message type is written.
#[derive(Clone, Debug)]
pub struct Schema {
    name: String,
}

impl Schema {
    /// Traces `T`.
    pub fn of<T: Serialize + DeserializeOwned + 'static>() -> Result<Schema, SchemaError> {
        let full = std::any::type_name::<T>();
        Ok(Schema {
            name: full.rsplit("::").next().unwrap_or(full).to_owned(),
        })
    }
    /// The kind.
    pub fn name(&self) -> &str {
        &self.name
    }
    /// Appends the encoded value.
    pub fn encode<T: Serialize>(&self, value: &T, out: &mut Vec<u8>) -> Result<(), EncodeError> {
        serde_json::to_writer(out, value).map_err(|e| EncodeError(e.to_string()))
    }
    /// Reads a value back.
    pub fn decode<T: DeserializeOwned>(&self, bytes: &[u8]) -> Result<T, DecodeError> {
        serde_json::from_slice(bytes).map_err(|e| DecodeError(e.to_string()))
    }
}
