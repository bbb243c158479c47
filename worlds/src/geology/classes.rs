//! Classes of rock: what a rock of a class is made of and looks like, in distribution.

/// How many statistics describe the texture of a rock's picture.
pub const TEXTURE: usize = 4;

/// Their names, in order.
pub const TEXTURE_NAMES: [&str; TEXTURE] = ["contrast", "energy", "correlation", "anisotropy"];

/// A kind of rock: what its rocks are made of and look like, in distribution.
#[derive(Clone, Debug, PartialEq)]
pub struct RockClass {
    /// Its name.
    pub name: String,
    /// The fraction of each of the field's minerals by volume, in their order; sums to 1.
    pub fractions: Vec<f64>,
    /// How much the logarithms of the fractions scatter (standard deviation).
    pub scatter: f64,
    /// The median grain size \[um\].
    pub grain_um: f64,
    /// The mean share of a rock's surface that dust covers, 0 to 1.
    pub dust: f64,
    /// The mean of each texture statistic.
    pub texture: [f64; TEXTURE],
    /// The standard deviation of each texture statistic.
    pub texture_scatter: [f64; TEXTURE],
}
