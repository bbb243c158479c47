//! Where runs begin: responsibilities that classes might have.
//!
//! A start decides which maximum a run finds. Means chosen by distance alone fail on classes that
//! are long in one direction and narrow in another, or where columns have different units: the
//! long direction is cut in pieces. So starts measure distance in three ways in turn: by each column's
//! variance over all rocks; by its variance between neighbours, which is that within classes
//! wherever classes are apart (D. Art, R. Gnanadesikan and J. Kettenring, "Data-based metrics for
//! cluster analysis", Utilitas Mathematica 21A, 1982); and by both with other seeds. Beside them
//! the best model with one class fewer is split where that gains most.

use farside::random::{RandomKey, Stream};

use super::Table;

/// The inverse of each column's variance, in two ways.
pub(super) struct Scales {
    overall: Vec<f64>,
    nearby: Vec<f64>,
}

impl Scales {
    pub(super) fn of(table: &Table, floors: &[f64]) -> Scales {
        let inverse = |variance: f64, column: usize| 1.0 / variance.max(floors[column]);
        let columns = 0..table.columns();
        let overall: Vec<f64> = columns
            .map(|d| inverse(table.moments(d).map_or(0.0, |(_, variance)| variance), d))
            .collect();
        // Who is a neighbour depends on the scale: twice is enough to settle.
        let first = nearby(table, &overall, &inverse);
        let nearby = nearby(table, &first, &inverse);
        Scales { overall, nearby }
    }
}

/// The inverse variance of each column between nearest neighbours.
fn nearby(table: &Table, scale: &[f64], inverse: &dyn Fn(f64, usize) -> f64) -> Vec<f64> {
    let columns = table.columns();
    let (mut sum, mut count) = (vec![0.0; columns], vec![0.0; columns]);
    for a in 0..table.len() {
        let others = (0..table.len()).filter(|&b| b != a);
        let nearest = others
            .map(|b| (distance(table, scale, a, table.row(b), table.noise(b)), b))
            .min_by(|x, y| x.0.total_cmp(&y.0));
        let Some((_, b)) = nearest else { continue };
        for d in 0..columns {
            if table.noise(a)[d].is_finite() && table.noise(b)[d].is_finite() {
                let difference = table.row(a)[d] - table.row(b)[d];
                sum[d] += 0.5 * difference * difference;
                count[d] += 1.0;
            }
        }
    }
    (0..columns)
        .map(|d| {
            inverse(
                if count[d] > 0.0 {
                    sum[d] / count[d]
                } else {
                    0.0
                },
                d,
            )
        })
        .collect()
}

/// The mean squared distance of a row to a place, over the columns that both have.
fn distance(table: &Table, scale: &[f64], row: usize, place: &[f64], missing: &[f64]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for d in 0..table.columns() {
        if table.noise(row)[d].is_finite() && missing[d].is_finite() {
            let difference = table.row(row)[d] - place[d];
            sum += difference * difference * scale[d];
            count += 1.0;
        }
    }
    if count > 0.0 { sum / count } else { 0.0 }
}

/// Responsibilities of a start: each row wholly with its nearest seed. Seeds are rows, drawn with a
/// probability proportional to the squared distance to those drawn before (D. Arthur and S.
/// Vassilvitskii, "k-means++", SODA 2007), then moved to the means of their rows a few times.
pub(super) fn seeded(table: &Table, scales: &Scales, classes: usize, start: usize) -> Vec<f64> {
    let key = RandomKey::new(0).text("mixture start");
    let mut stream = key.number(classes as u64).number(start as u64).stream();
    let scale = match start % 2 {
        0 => &scales.nearby,
        _ => &scales.overall,
    };
    let mut nearest = vec![f64::INFINITY; table.len()];
    let mut class_of = vec![0usize; table.len()];
    let mut seed = stream.below(table.len() as u64) as usize;
    for class in 0..classes {
        for row in 0..table.len() {
            let d = distance(table, scale, row, table.row(seed), table.noise(seed));
            if d < nearest[row] {
                (nearest[row], class_of[row]) = (d, class);
            }
        }
        seed = drawn(&nearest, &mut stream);
    }
    for _ in 0..5 {
        reassign(table, scale, classes, &mut class_of);
    }
    let mut shares = vec![0.0; table.len() * classes];
    for (row, &class) in class_of.iter().enumerate() {
        shares[row * classes + class] = 1.0;
    }
    shares
}

/// A row drawn with a probability proportional to its weight; any if all weigh nothing.
fn drawn(weights: &[f64], stream: &mut Stream) -> usize {
    let total: f64 = weights.iter().sum();
    let mut left = stream.uniform() * total;
    for (row, weight) in weights.iter().enumerate() {
        left -= weight;
        if left < 0.0 {
            return row;
        }
    }
    weights.len() - 1
}

/// One step of k-means.
fn reassign(table: &Table, scale: &[f64], classes: usize, class_of: &mut [usize]) {
    let columns = table.columns();
    let mut means = vec![0.0; classes * columns];
    let mut count = vec![0.0; classes * columns];
    for (row, &class) in class_of.iter().enumerate() {
        for d in 0..columns {
            if table.noise(row)[d].is_finite() {
                means[class * columns + d] += table.row(row)[d];
                count[class * columns + d] += 1.0;
            }
        }
    }
    // A column that no row of a class has is missing in its mean too.
    let mut missing = vec![0.0; classes * columns];
    for (at, count) in count.into_iter().enumerate() {
        match count > 0.0 {
            true => means[at] /= count,
            false => missing[at] = f64::INFINITY,
        }
    }
    for (row, class_of) in class_of.iter_mut().enumerate() {
        let at = |class: usize| class * columns..(class + 1) * columns;
        let d = |class| distance(table, scale, row, &means[at(class)], &missing[at(class)]);
        let nearest = (0..classes).map(|class| (d(class), class));
        if let Some((_, class)) = nearest.min_by(|a, b| a.0.total_cmp(&b.0)) {
            *class_of = class;
        }
    }
}

/// Responsibilities of a start: those of a model with one class fewer, of which one class is cut
/// in two at its mean in one column.
pub(super) fn split(
    table: &Table,
    fewer: &[f64],
    classes: usize,
    class: usize,
    column: usize,
    mean: f64,
) -> Vec<f64> {
    let mut shares = vec![0.0; table.len() * classes];
    for row in 0..table.len() {
        let old = &fewer[row * (classes - 1)..(row + 1) * (classes - 1)];
        let new = &mut shares[row * classes..(row + 1) * classes];
        new[..classes - 1].copy_from_slice(old);
        if table.noise(row)[column].is_infinite() {
            new[class] *= 0.5;
            new[classes - 1] = new[class];
        } else if table.row(row)[column] > mean {
            new[classes - 1] = std::mem::take(&mut new[class]);
        }
    }
    shares
}
