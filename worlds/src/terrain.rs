//! Height fields: terrain as a grid of heights, with slopes and lines of sight.
//!
//! A height field knows no craters or rocks; those are made by [`crate::crater`] and
//! [`crate::rocks`]. Whether a radio signal gets through is for a link to decide; here is only
//! whether the ground is in the way, and by how much.

mod noise;

use nalgebra::{Point2, Point3, Vector2};

pub(crate) use noise::Noise;

use crate::error::TerrainError;

/// The most samples a height field may have (it then takes 128 MB).
pub const MAX_SAMPLES: usize = 1 << 24;

/// A grid of heights \[m\], bilinear between its samples and level beyond its edges: outside, the
/// height is that of the nearest point of the edge.
///
/// ```
/// use farside_worlds::HeightField;
/// use nalgebra::Point2;
/// // A ridge 3 m high along x = 10 m, on a grid of 10 m.
/// let heights_m = vec![0.0, 3.0, 0.0, 0.0, 3.0, 0.0];
/// let ridge = HeightField::new(Point2::new(0.0, 0.0), 10.0, 3, heights_m)?;
/// assert_eq!(ridge.height_m(5.0, 5.0), 1.5);
/// let (west, east) = (ridge.antenna_m(0.0, 5.0, 2.0), ridge.antenna_m(20.0, 5.0, 2.0));
/// assert!(!ridge.line_of_sight(west, east));
/// assert_eq!(ridge.clearance_m(west, east), -1.0);
/// # Ok::<(), farside_worlds::TerrainError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct HeightField {
    origin_m: Point2<f64>,
    resolution_m: f64,
    columns: usize,
    rows: usize,
    heights_m: Vec<f64>,
}

impl HeightField {
    /// The field whose south-western sample lies at `origin_m` and whose samples are
    /// `resolution_m` apart; `heights_m` row by row, each of `columns` from west to east, the rows
    /// from south to north.
    ///
    /// # Errors
    /// When there are fewer than two rows or columns, the last row is cut short, there are more
    /// than 2^24 samples, or the origin, the resolution or a height is not finite (the resolution
    /// must be positive, too).
    pub fn new(
        origin_m: Point2<f64>,
        resolution_m: f64,
        columns: usize,
        heights_m: Vec<f64>,
    ) -> Result<HeightField, TerrainError> {
        let samples = heights_m.len();
        if samples > MAX_SAMPLES {
            return Err(TerrainError::TooManySamples {
                limit: MAX_SAMPLES,
                actual: samples,
            });
        }
        if columns < 2 || samples / columns < 2 || !samples.is_multiple_of(columns) {
            return Err(TerrainError::Shape { columns, samples });
        }
        if !(resolution_m > 0.0 && resolution_m.is_finite()) {
            return Err(TerrainError::Resolution {
                actual_m: resolution_m,
            });
        }
        if !(origin_m.x.is_finite() && origin_m.y.is_finite()) {
            return Err(TerrainError::Origin {
                x_m: origin_m.x,
                y_m: origin_m.y,
            });
        }
        if let Some(sample) = heights_m.iter().position(|h| !h.is_finite()) {
            let (column, row) = (sample % columns, sample / columns);
            return Err(TerrainError::Height {
                column,
                row,
                height_m: heights_m[sample],
            });
        }
        let rows = samples / columns;
        Ok(HeightField {
            origin_m,
            resolution_m,
            columns,
            rows,
            heights_m,
        })
    }

    /// The position of the south-western sample \[m\].
    pub fn origin_m(&self) -> Point2<f64> {
        self.origin_m
    }

    /// The distance between neighbouring samples \[m\].
    pub fn resolution_m(&self) -> f64 {
        self.resolution_m
    }

    /// Samples in a row, from west to east; at least 2.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Rows, from south to north; at least 2.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// All samples \[m\], row by row from the south, each from west to east.
    pub fn heights_m(&self) -> &[f64] {
        &self.heights_m
    }

    /// The position of a sample \[m\].
    pub fn sample_position_m(&self, column: usize, row: usize) -> Point2<f64> {
        let offset = Vector2::new(column as f64, row as f64) * self.resolution_m;
        self.origin_m + offset
    }

    /// The terrain's height at (x, y) \[m\].
    pub fn height_m(&self, x_m: f64, y_m: f64) -> f64 {
        let (column, east) = self.cell((x_m - self.origin_m.x) / self.resolution_m, self.columns);
        let (row, north) = self.cell((y_m - self.origin_m.y) / self.resolution_m, self.rows);
        let at = |c: usize, r: usize| self.heights_m[r * self.columns + c];
        let south_m = at(column, row) * (1.0 - east) + at(column + 1, row) * east;
        let north_m = at(column, row + 1) * (1.0 - east) + at(column + 1, row + 1) * east;
        south_m * (1.0 - north) + north_m * north
    }

    /// The cell of a coordinate counted in samples, and the share of the cell before it.
    fn cell(&self, samples: f64, count: usize) -> (usize, f64) {
        let inside = samples.clamp(0.0, (count - 1) as f64);
        // A NaN becomes cell 0; the share, and so the height, stays NaN.
        let cell = (inside as usize).min(count - 2);
        (cell, inside - cell as f64)
    }

    /// The rise to the east and to the north \[m/m\], by central differences over one resolution to
    /// either side.
    pub fn gradient(&self, x_m: f64, y_m: f64) -> Vector2<f64> {
        let step = self.resolution_m;
        let east = self.height_m(x_m + step, y_m) - self.height_m(x_m - step, y_m);
        let north = self.height_m(x_m, y_m + step) - self.height_m(x_m, y_m - step);
        Vector2::new(east, north) / (2.0 * step)
    }

    /// The angle of the steepest ascent at (x, y) \[rad\], 0 where it is level.
    pub fn slope_rad(&self, x_m: f64, y_m: f64) -> f64 {
        let gradient = self.gradient(x_m, y_m);
        libm::atan(libm::hypot(gradient.x, gradient.y))
    }

    /// The point of an antenna `mast_m` above the ground at (x, y) \[m\].
    pub fn antenna_m(&self, x_m: f64, y_m: f64, mast_m: f64) -> Point3<f64> {
        Point3::new(x_m, y_m, self.height_m(x_m, y_m) + mast_m)
    }

    /// Whether the straight line between two points stays at or above the ground.
    pub fn line_of_sight(&self, from_m: Point3<f64>, to_m: Point3<f64>) -> bool {
        self.clearance_m(from_m, to_m) >= 0.0
    }

    /// The least height of the straight line between two points over the ground below it \[m\];
    /// negative where the ground is in the way. Exact for the bilinear surface.
    pub fn clearance_m(&self, from_m: Point3<f64>, to_m: Point3<f64>) -> f64 {
        let way = to_m - from_m;
        let over = |t: f64| {
            let p = from_m + way * t;
            p.z - self.height_m(p.x, p.y)
        };
        let cuts = self.cuts(from_m.xy(), to_m.xy());
        let mut least_m = over(0.0).min(over(1.0));
        for pair in cuts.windows(2) {
            // Within one cell the height over the ground is a parabola in t.
            let (start, end) = (over(pair[0]), over(pair[1]));
            let middle = over(0.5 * (pair[0] + pair[1]));
            let bend = 2.0 * (start + end) - 4.0 * middle;
            let rise = end - start - bend;
            least_m = least_m.min(start).min(end);
            if bend > 0.0 {
                let lowest = (-rise / (2.0 * bend)).clamp(0.0, 1.0);
                least_m = least_m.min(start + lowest * (rise + lowest * bend));
            }
        }
        least_m
    }

    /// Where the segment passes from cell to cell, as shares of its length, with 0 and 1, sorted.
    /// At most one for each row and column, however long the segment.
    fn cuts(&self, from_m: Point2<f64>, to_m: Point2<f64>) -> Vec<f64> {
        let mut cuts = vec![0.0, 1.0];
        let mut add = |from: f64, to: f64, origin: f64, count: usize| {
            if from != to {
                let lines = (0..count).map(|i| origin + i as f64 * self.resolution_m);
                let shares = lines.map(|line| (line - from) / (to - from));
                cuts.extend(shares.filter(|t| (0.0..1.0).contains(t)));
            }
        };
        add(from_m.x, to_m.x, self.origin_m.x, self.columns);
        add(from_m.y, to_m.y, self.origin_m.y, self.rows);
        cuts.sort_by(f64::total_cmp);
        cuts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A tilted plane z = 0.5 x - 0.25 y.
    fn plane() -> HeightField {
        let heights_m =
            (0..5).flat_map(|r| (0..4).map(move |c| 0.5 * f64::from(c) - 0.25 * f64::from(r)));
        HeightField::new(Point2::origin(), 1.0, 4, heights_m.collect()).unwrap()
    }

    #[test]
    fn a_plane_is_met_exactly() {
        let field = plane();
        assert!((field.height_m(1.3, 2.7) - (0.65 - 0.675)).abs() < 1e-12);
        assert!((field.gradient(1.5, 2.0) - Vector2::new(0.5, -0.25)).norm() < 1e-12);
        let slope_rad = libm::atan(libm::sqrt(0.3125));
        assert!((field.slope_rad(1.5, 2.0) - slope_rad).abs() < 1e-12);
    }

    #[test]
    fn it_is_level_outside() {
        let field = plane();
        assert_eq!(field.height_m(-100.0, 0.0), field.height_m(0.0, 0.0));
        assert_eq!(field.height_m(1e300, 1e300), field.height_m(3.0, 4.0));
        assert!(field.height_m(f64::NAN, 0.0).is_nan());
    }

    #[test]
    fn each_rule_has_its_error() {
        let new = |resolution_m, columns, heights_m: Vec<f64>| {
            HeightField::new(Point2::origin(), resolution_m, columns, heights_m).unwrap_err()
        };
        assert_eq!(
            new(1.0, 1, vec![0.0; 4]),
            TerrainError::Shape {
                columns: 1,
                samples: 4
            }
        );
        assert_eq!(
            new(1.0, 2, vec![0.0; 5]),
            TerrainError::Shape {
                columns: 2,
                samples: 5
            }
        );
        assert_eq!(
            new(1.0, 4, vec![0.0; 4]),
            TerrainError::Shape {
                columns: 4,
                samples: 4
            }
        );
        assert_eq!(
            new(0.0, 2, vec![0.0; 4]),
            TerrainError::Resolution { actual_m: 0.0 }
        );
        let steep = new(1.0, 2, vec![0.0, 0.0, f64::INFINITY, 0.0]);
        let height_m = f64::INFINITY;
        assert_eq!(
            steep,
            TerrainError::Height {
                column: 0,
                row: 1,
                height_m
            }
        );
    }

    fn bumps(heights: Vec<f64>) -> HeightField {
        HeightField::new(Point2::new(-10.0, -10.0), 5.0, 5, heights).unwrap()
    }

    proptest! {
        #[test]
        fn clearance_is_that_of_a_fine_walk(
            heights in prop::collection::vec(0.0f64..4.0, 25),
            (ax, ay, bx, by) in (-15.0f64..15.0, -15.0f64..15.0, -15.0f64..15.0, -15.0f64..15.0),
        ) {
            let field = bumps(heights);
            let (a, b) = (field.antenna_m(ax, ay, 1.0), field.antenna_m(bx, by, 1.0));
            let steps = 4000;
            let walked_m = (0..=steps)
                .map(|i| {
                    let p = a + (b - a) * (f64::from(i) / f64::from(steps));
                    p.z - field.height_m(p.x, p.y)
                })
                .fold(f64::INFINITY, f64::min);
            let clearance_m = field.clearance_m(a, b);
            prop_assert!(clearance_m <= walked_m + 1e-9, "{clearance_m} over {walked_m}");
            prop_assert!(clearance_m >= walked_m - 0.02, "{clearance_m} under {walked_m}");
            let back_m = field.clearance_m(b, a);
            prop_assert!((clearance_m - back_m).abs() < 1e-9, "{clearance_m} and back {back_m}");
        }
    }
}
