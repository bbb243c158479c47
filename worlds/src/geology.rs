//! Geology: what kinds of rock there are, and the stories that lay them out over the ground.
//!
//! A [`RockClass`] is a kind of rock as a distribution: mineral fractions, grain size, dust and
//! texture, each with its scatter. A [`Story`] is how a field came to be: which class to expect at
//! which place. Sizes of rocks come from [`crate::rocks`]; spectra from [`crate::spectra`];
//! [`crate::rock_field`] puts all of it together.

mod classes;
mod error;
mod story;

pub use classes::{RockClass, TEXTURE, TEXTURE_NAMES};
pub use error::GeologyError;
pub use story::{Story, StoryKind};
