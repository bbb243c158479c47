//! How observations are told apart on a map: by the shape of their mark.

use farside_actors::figure::svg::path;

/// The shape of a mark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Shape {
    /// From afar: a triangle.
    Afar,
    /// An image from near: a square.
    Image,
    /// A spectrum from near: a diamond.
    Spectrum,
}

impl Shape {
    /// The outline of a mark around a point, as a path's data.
    pub(crate) fn outline(self, (x, y): (f64, f64)) -> String {
        let points: &[(f64, f64)] = match self {
            Shape::Image => &[(-3.6, -3.6), (3.6, -3.6), (3.6, 3.6), (-3.6, 3.6)],
            Shape::Spectrum => &[(0.0, -5.0), (5.0, 0.0), (0.0, 5.0), (-5.0, 0.0)],
            Shape::Afar => &[(0.0, -5.0), (4.6, 3.6), (-4.6, 3.6)],
        };
        format!("{}Z", path(points.iter().map(|(dx, dy)| (x + dx, y + dy))))
    }

    /// Where the mark of a goal at a point is drawn: those of one rock that are made from one place beside each
    /// other.
    pub(crate) fn beside(self, (x, y): (f64, f64)) -> (f64, f64) {
        match self {
            Shape::Image => (x - 4.5, y),
            Shape::Spectrum => (x + 4.5, y),
            Shape::Afar => (x, y),
        }
    }
}
