//! Geology: what kinds of rock there are, and the stories that lay them out over the ground.
//!
//! A [`RockClass`] is a kind of rock as a distribution: mineral fractions, grain size, dust and
//! texture, each with its scatter. A [`Story`] is how a field came to be: which class to expect at
//! which place, and where large rocks lie. How many rocks of which size there are says
//! [`crate::rocks`]; spectra come from [`crate::spectra`]; [`crate::rock_field`] puts all of it
//! together.

mod classes;
mod error;
mod story;

pub use classes::{
    FRACTION_SUM_TOLERANCE, MAX_CLASSES, RockClass, RockSample, TEXTURE, TEXTURE_NAMES,
};
pub use error::GeologyError;
pub use story::{Evidence, Story, StoryKind};

#[cfg(test)]
mod tests;
