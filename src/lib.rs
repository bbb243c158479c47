//! The Farside kernel.

pub mod encoding;
