//! Straight lines through points: ordinary least squares, and the share of the spread that the line
//! explains.

/// A straight line through points, by least squares of the vertical distances.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// By how much y grows for each unit of x.
    pub slope: f64,
    /// The y at x = 0.
    pub intercept: f64,
    /// The coefficient of determination: 1 minus the ratio of the squared distances from the line
    /// to those from the mean of y; 1 if all points are on the line. Not a number if all y are
    /// equal.
    pub r_squared: f64,
}

/// The line through some points. Points that are no finite numbers are left out. None for fewer
/// than two different x.
///
/// Each point counts the same: a study's cells all have the same seeds.
///
/// ```
/// use farside_experiments::stats::line::least_squares;
/// let line = least_squares(&[(1.0, 3.0), (2.0, 5.0), (4.0, 9.0)]).unwrap();
/// assert_eq!((line.slope, line.intercept, line.r_squared), (2.0, 1.0, 1.0));
/// assert_eq!(least_squares(&[(1.0, 3.0), (1.0, 5.0)]), None);
/// ```
pub fn least_squares(points: &[(f64, f64)]) -> Option<Line> {
    let finite = |(x, y): &&(f64, f64)| x.is_finite() && y.is_finite();
    let points: Vec<(f64, f64)> = points.iter().filter(finite).copied().collect();
    let count = points.len() as f64;
    let mean_x = points.iter().map(|(x, _)| x).sum::<f64>() / count;
    let mean_y = points.iter().map(|(_, y)| y).sum::<f64>() / count;
    // From the means, and not from zero: squares of large numbers leave no digits for differences.
    let sum = |of: fn(f64, f64) -> f64| -> f64 {
        let apart = points.iter().map(|(x, y)| (x - mean_x, y - mean_y));
        apart.map(|(x, y)| of(x, y)).sum()
    };
    let (xx, xy, yy) = (sum(|x, _| x * x), sum(|x, y| x * y), sum(|_, y| y * y));
    if xx.is_nan() || xx <= 0.0 {
        return None;
    }
    let slope = xy / xx;
    let residual = |(x, y): &(f64, f64)| y - mean_y - slope * (x - mean_x);
    let squares = points.iter().map(|point| residual(point) * residual(point));
    Some(Line {
        slope,
        intercept: mean_y - slope * mean_x,
        r_squared: if yy > 0.0 {
            1.0 - squares.sum::<f64>() / yy
        } else {
            f64::NAN
        },
    })
}

impl Line {
    /// The y at an x.
    pub fn at(&self, x: f64) -> f64 {
        self.intercept + self.slope * x
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The reference is the textbook's formula in exact fractions (Python's `fractions`).
    #[test]
    fn lines_are_those_of_exact_fractions() {
        let points = [
            (25.0, 410.0),
            (50.0, 1003.0),
            (75.0, 1800.0),
            (100.0, 3100.0),
        ];
        let line = least_squares(&points).unwrap();
        assert!((line.slope - 35.468).abs() < 1e-9, "{line:?}");
        assert!((line.intercept - -638.5).abs() < 1e-9, "{line:?}");
        assert!(
            (line.r_squared - 0.968_124_965_253_123_2).abs() < 1e-12,
            "{line:?}"
        );
        let falling = least_squares(&[(0.0, 1.0), (1.0, 0.5), (2.0, f64::NAN), (3.0, -0.5)]);
        assert_eq!(falling.unwrap().slope, -0.5);
        assert!(
            least_squares(&[(0.0, 4.0), (1.0, 4.0)])
                .unwrap()
                .r_squared
                .is_nan()
        );
        assert_eq!(least_squares(&[]), None);
    }

    proptest! {
        /// No other line is nearer to the points.
        #[test]
        fn a_line_is_the_nearest(
            ys in proptest::collection::vec(-1e3..1e3f64, 3..12),
            slope in -0.5..0.5f64,
            shift in -5.0..5.0f64,
        ) {
            let points: Vec<(f64, f64)> =
                ys.iter().enumerate().map(|(x, y)| (x as f64 * 10.0, *y)).collect();
            let line = least_squares(&points).unwrap();
            let error = |slope: f64, intercept: f64| -> f64 {
                let apart = points.iter().map(|(x, y)| y - intercept - slope * x);
                apart.map(|d| d * d).sum()
            };
            let least = error(line.slope, line.intercept);
            prop_assert!(least <= error(line.slope + slope, line.intercept + shift) * (1.0 + 1e-9));
            // Nor one that is a little steeper or higher: what is left has no slope and no mean.
            let left = |(x, y): &(f64, f64)| y - line.at(*x);
            let sum: f64 = points.iter().map(left).sum();
            let turn: f64 = points.iter().map(|point| left(point) * point.0).sum();
            prop_assert!(sum.abs() < 1e-6 && turn.abs() < 1e-4, "{sum} {turn}");
            prop_assert!(line.r_squared < 1.0 + 1e-9 && line.r_squared > -1e-9);
        }
    }
}
