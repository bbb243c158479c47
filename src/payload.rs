//! What a message is, and that it can be written down.

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::encoding::{EncodeError, Schema};

/// A message: any type that serde can write and read back, and that may cross threads.
///
/// Implemented for every such type; derive `Serialize` and `Deserialize` and nothing else.
pub trait Message: Serialize + DeserializeOwned + Send + 'static {}

impl<M: Serialize + DeserializeOwned + Send + 'static> Message for M {}

/// A message whose type is not known, to those who only want its bytes: links ask for its size.
pub(crate) trait Encode {
    /// Appends the encoded message to `out`.
    fn encode(&self, schema: &Schema, out: &mut Vec<u8>) -> Result<(), EncodeError>;
}
