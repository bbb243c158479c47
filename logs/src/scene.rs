//! How drawings are written: as messages of Foxglove's published schemas.

mod encode;

pub(crate) use encode::Encoded;
