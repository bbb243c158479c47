//! What is packed in `google.protobuf.Any`: a message of any type, named by an address.

use std::borrow::Cow;
use std::sync::Arc;

use super::{Side, held, merged, side};
use crate::channel::ChannelInfo;
use crate::schema::{MessageType, Types};
use crate::wire::Value;

/// A message that was packed, of a type that is known.
pub(super) struct Packed<'a> {
    /// The address of its type: `type.googleapis.com/pkg.Type`.
    pub(super) url: &'a str,
    pub(super) bytes: Cow<'a, [u8]>,
    pub(super) side: Side<'a>,
}

/// What an `Any` holds, if `of` is one, and its type is known to its schema or to another of the log.
pub(super) fn packed<'a>(
    bytes: &'a [u8],
    of: &MessageType,
    (types, others): (&'a Types, &'a [Arc<ChannelInfo>]),
) -> Option<Packed<'a>> {
    if of.name != "google.protobuf.Any" {
        return None;
    }
    let mut held = held(bytes, of)?;
    let url = held.remove(&1)?.last().copied().and_then(Value::text)?;
    let content = held.remove(&2).unwrap_or_default();
    let name = url.rsplit('/').next().unwrap_or(url);
    let schemas = others.iter().filter_map(|channel| channel.schema.as_ref());
    let others = schemas.filter_map(|schema| schema.types().ok());
    let mut all = std::iter::once(types).chain(others);
    let side = all.find_map(|types| Some(side(types, Some(types.find(name)?))))?;
    Some(Packed {
        url,
        bytes: merged(
            content
                .get(content.len().saturating_sub(1)..)
                .unwrap_or_default(),
        ),
        side,
    })
}
