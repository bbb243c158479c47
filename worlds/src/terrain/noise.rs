//! Smooth noise, for the roughness of generated ground.

use farside::random::Stream;

/// Smooth noise between random values on a lattice.
pub(crate) struct Noise {
    half_m: f64,
    length_m: f64,
    points: usize,
    values_m: Vec<f64>,
}

impl Noise {
    /// Noise over the square of this half side around the origin: its values lie `length_m` apart and
    /// within the amplitude.
    pub(crate) fn new(half_m: f64, length_m: f64, amplitude_m: f64, stream: &mut Stream) -> Noise {
        let points = libm::ceil(2.0 * half_m / length_m) as usize + 2;
        let values_m = (0..points * points)
            .map(|_| stream.uniform_in(-amplitude_m, amplitude_m))
            .collect();
        Noise {
            half_m,
            length_m,
            points,
            values_m,
        }
    }

    /// The noise at a place.
    pub(crate) fn at(&self, x_m: f64, y_m: f64) -> f64 {
        let (column, east) = self.cell(x_m);
        let (row, north) = self.cell(y_m);
        let value = |c: usize, r: usize| self.values_m[r * self.points + c];
        let south_m = value(column, row) * (1.0 - east) + value(column + 1, row) * east;
        let north_m = value(column, row + 1) * (1.0 - east) + value(column + 1, row + 1) * east;
        south_m * (1.0 - north) + north_m * north
    }

    /// The lattice cell of a coordinate and the smoothed share of it.
    fn cell(&self, coordinate_m: f64) -> (usize, f64) {
        let at = ((coordinate_m + self.half_m) / self.length_m).max(0.0);
        let cell = (at as usize).min(self.points - 2);
        let share = (at - cell as f64).clamp(0.0, 1.0);
        (
            cell,
            share * share * share * (share * (share * 6.0 - 15.0) + 10.0),
        )
    }
}
