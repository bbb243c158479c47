//! Figures as SVG: what plots of studies and pictures of runs are drawn with.
//!
//! What this is not: plots. What a figure shows is the business of who draws it; here are frames,
//! axes, scales, legends, colours and numbers.

pub mod colours;
pub mod ground;
pub mod numbers;
pub mod relief;
pub mod scale;
mod style;
pub mod svg;

pub use svg::Figure;

/// The style of figures, in light, dark and print.
pub const STYLE: &str = include_str!("figure/figure.css");
