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
