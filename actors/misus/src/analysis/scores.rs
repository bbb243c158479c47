//! How good a learnt model is, against the truth and by itself. For metrics: rovers know no truth.

/// The adjusted Rand index of two partitions of the same items: 1 for equal ones, 0 on average for
/// unrelated ones (L. Hubert and P. Arabie, "Comparing partitions", Journal of Classification 2, 1985).
/// 1 if there is nothing to tell apart in either.
///
/// ```
/// use farside_misus::analysis::scores::adjusted_rand_index;
/// assert_eq!(adjusted_rand_index(&[0, 0, 1, 1], &[5, 5, 2, 2]), 1.0);
/// assert!(adjusted_rand_index(&[0, 0, 1, 1], &[0, 1, 0, 1]) < 0.0);
/// ```
///
/// # Panics
/// When they have different lengths.
pub fn adjusted_rand_index(a: &[usize], b: &[usize]) -> f64 {
    let counts = contingency(a, b);
    let pairs = |n: f64| 0.5 * n * (n - 1.0);
    let both: f64 = counts.cells.iter().map(|&n| pairs(n)).sum();
    let in_a: f64 = counts.of_a().map(pairs).sum();
    let in_b: f64 = counts.of_b().map(pairs).sum();
    let expected = in_a * in_b / pairs(a.len() as f64).max(1.0);
    let most = 0.5 * (in_a + in_b);
    if most == expected {
        return 1.0;
    }
    (both - expected) / (most - expected)
}

/// How many items are in each pair of parts.
struct Contingency {
    columns: usize,
    cells: Vec<f64>,
}

impl Contingency {
    fn of_a(&self) -> impl Iterator<Item = f64> + '_ {
        self.cells.chunks(self.columns).map(|row| row.iter().sum())
    }

    fn of_b(&self) -> impl Iterator<Item = f64> + '_ {
        (0..self.columns).map(|b| self.cells.iter().skip(b).step_by(self.columns).sum())
    }
}

fn contingency(a: &[usize], b: &[usize]) -> Contingency {
    assert_eq!(a.len(), b.len(), "partitions of the same items");
    let parts = |labels: &[usize]| labels.iter().max().map_or(1, |most| most + 1);
    let columns = parts(b);
    let mut cells = vec![0.0; parts(a) * columns];
    for (&a, &b) in a.iter().zip(b) {
        cells[a * columns + b] += 1.0;
    }
    Contingency { columns, cells }
}

/// The share of items whose cluster's commonest label is their own: 1 if every cluster has one label.
/// 1 if there are none. It rises with the number of clusters, so say that too.
///
/// ```
/// use farside_misus::analysis::scores::purity;
/// assert_eq!(purity(&[0, 0, 0, 1], &[3, 3, 4, 4]), 0.75);
/// ```
///
/// # Panics
/// When there are not as many clusters as labels.
pub fn purity(clusters: &[usize], labels: &[usize]) -> f64 {
    if clusters.is_empty() {
        return 1.0;
    }
    let counts = contingency(clusters, labels);
    let rows = counts.cells.chunks(counts.columns);
    let commonest = rows.map(|row| row.iter().copied().fold(0.0, f64::max));
    commonest.sum::<f64>() / clusters.len() as f64
}

/// The class of highest probability of each row; of equal ones the first.
///
/// # Panics
/// When `classes` is 0.
pub fn hard(responsibilities: &[f64], classes: usize) -> Vec<usize> {
    let best =
        |row: &[f64]| (1..classes).fold(0, |best, k| if row[k] > row[best] { k } else { best });
    responsibilities.chunks_exact(classes).map(best).collect()
}

/// The mean entropy of the rows' class probabilities \[nat\]; 0 if all are certain, or there are none.
///
/// # Panics
/// When `classes` is 0.
pub fn posterior_entropy(responsibilities: &[f64], classes: usize) -> f64 {
    let rows = responsibilities.len() / classes;
    let surprise = |&p: &f64| if p > 0.0 { -p * libm::log(p) } else { 0.0 };
    responsibilities.iter().map(surprise).sum::<f64>() / rows.max(1) as f64
}

/// The total variation distance between the learnt shares of classes and the true ones, learnt classes
/// matched to true ones so that as many rocks as possible agree: half the sum of absolute
/// differences, 0 to 1. A class that nothing is matched to counts with its whole share.
///
/// ```
/// use farside_misus::analysis::scores::distribution_error;
/// // Three rocks of one class and one of the other; all four taken for one class.
/// assert_eq!(distribution_error(&[1.0], &[0, 0, 0, 0], &[0, 0, 0, 1]), 0.25);
/// assert_eq!(distribution_error(&[0.25, 0.75], &[1, 1, 1, 0], &[0, 0, 0, 1]), 0.0);
/// ```
///
/// # Panics
/// When there are not as many learnt classes as true ones, item by item, or a class without a share.
pub fn distribution_error(shares: &[f64], learnt: &[usize], truth: &[usize]) -> f64 {
    let total = (truth.len() as f64).max(1.0);
    let counts = contingency(learnt, truth);
    let mut of_truth: Vec<f64> = counts.of_b().map(|count| count / total).collect();
    let matched = matched_classes(learnt, truth, shares.len());
    of_truth.resize(matched.len(), 0.0);
    let difference = |(a, &b): (usize, &usize)| {
        let share = shares.get(a).copied().unwrap_or(0.0);
        (share - of_truth[b]).abs()
    };
    0.5 * matched.iter().enumerate().map(difference).sum::<f64>()
}

/// For each learnt class the true one that it is matched to, one to one, so that as many items as
/// possible agree. There are as many of both as there are labels, and at least `classes`: those that
/// only one side has match what is left over of the other.
pub(crate) fn matched_classes(learnt: &[usize], truth: &[usize], classes: usize) -> Vec<usize> {
    let counts = contingency(learnt, truth);
    let rows = counts.cells.len() / counts.columns;
    let size = rows.max(counts.columns).max(classes);
    let mut gain = vec![0.0; size * size];
    for (a, row) in counts.cells.chunks(counts.columns).enumerate() {
        gain[a * size..a * size + row.len()].copy_from_slice(row);
    }
    best_assignment(&gain, size)
}

/// The column of each row of a square matrix such that the sum of entries is the greatest (the
/// Hungarian method, by shortest augmenting paths; of equal ones always the same).
fn best_assignment(gain: &[f64], size: usize) -> Vec<usize> {
    let most = gain.iter().copied().fold(0.0, f64::max);
    let cost = |row: usize, column: usize| most - gain[row * size + column];
    // Rows and columns from 1, as the method has them; 0 is where a new row begins.
    let (mut of_row, mut of_column) = (vec![0.0; size + 1], vec![0.0; size + 1]);
    let mut row_of = vec![0usize; size + 1];
    for row in 1..=size {
        row_of[0] = row;
        let mut least = vec![f64::INFINITY; size + 1];
        let mut before = vec![0usize; size + 1];
        let mut is_done = vec![false; size + 1];
        let mut column = 0;
        while row_of[column] != 0 {
            is_done[column] = true;
            let from = row_of[column];
            let (mut step, mut next) = (f64::INFINITY, 0);
            for to in 1..=size {
                if is_done[to] {
                    continue;
                }
                let reduced = cost(from - 1, to - 1) - of_row[from] - of_column[to];
                if reduced < least[to] {
                    (least[to], before[to]) = (reduced, column);
                }
                if least[to] < step {
                    (step, next) = (least[to], to);
                }
            }
            for to in 0..=size {
                if is_done[to] {
                    of_row[row_of[to]] += step;
                    of_column[to] -= step;
                } else {
                    least[to] -= step;
                }
            }
            column = next;
        }
        while column != 0 {
            row_of[column] = row_of[before[column]];
            column = before[column];
        }
    }
    let mut column_of = vec![0; size];
    for column in 1..=size {
        column_of[row_of[column] - 1] = column - 1;
    }
    column_of
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// By its definition: pairs of items that both partitions treat alike.
    fn rand_by_pairs(a: &[usize], b: &[usize]) -> f64 {
        let (mut both, mut in_a, mut in_b, mut all) = (0.0, 0.0, 0.0, 0.0);
        for i in 0..a.len() {
            for j in 0..i {
                let (same_a, same_b) = (a[i] == a[j], b[i] == b[j]);
                all += 1.0;
                in_a += f64::from(u8::from(same_a));
                in_b += f64::from(u8::from(same_b));
                both += f64::from(u8::from(same_a && same_b));
            }
        }
        let expected = in_a * in_b / all;
        (both - expected) / (0.5 * (in_a + in_b) - expected)
    }

    fn permutations(size: usize) -> Vec<Vec<usize>> {
        if size == 0 {
            return vec![vec![]];
        }
        let shorter = permutations(size - 1);
        let insert = |at: usize, p: &[usize]| {
            let mut p = p.to_vec();
            p.insert(at, size - 1);
            p
        };
        (0..size)
            .flat_map(|at| shorter.iter().map(move |p| insert(at, p)))
            .collect()
    }

    proptest! {
        #[test]
        fn rand_index_is_that_of_pairs(
            labels in prop::collection::vec((0usize..4, 0usize..3), 2..40),
        ) {
            let (a, b): (Vec<_>, Vec<_>) = labels.into_iter().unzip();
            let expected = rand_by_pairs(&a, &b);
            prop_assume!(expected.is_finite());
            prop_assert!((adjusted_rand_index(&a, &b) - expected).abs() < 1e-12);
            prop_assert_eq!(adjusted_rand_index(&a, &a), 1.0);
        }

        #[test]
        fn assignments_are_the_best(size in 1usize..6, seed: u64) {
            let mut stream = farside::random::RandomKey::new(seed).stream();
            let gain: Vec<f64> = (0..size * size).map(|_| stream.below(20) as f64).collect();
            let sum = |p: &[usize]| (0..size).map(|row| gain[row * size + p[row]]).sum::<f64>();
            let best = permutations(size).iter().map(|p| sum(p)).fold(0.0, f64::max);
            prop_assert_eq!(sum(&best_assignment(&gain, size)), best);
        }

        #[test]
        fn errors_of_shares_are_distances(
            labels in prop::collection::vec((0usize..4, 0usize..3), 1..40),
        ) {
            let (learnt, truth): (Vec<_>, Vec<_>) = labels.into_iter().unzip();
            let shares = [0.4, 0.3, 0.2, 0.1];
            let error = distribution_error(&shares, &learnt, &truth);
            prop_assert!((0.0..=1.0 + 1e-12).contains(&error));
        }
    }
}
