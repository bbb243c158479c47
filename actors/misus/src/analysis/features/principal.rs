//! Principal components, by Jacobi's rotations: exact to rounding, and the same on every machine.

/// The most sweeps over all pairs of rows; some eight are enough.
const MAX_SWEEPS: usize = 60;

/// The first principal components of centred rows, one after the other, each of unit length. Its
/// largest entry is positive, since eigenvectors have no sign of their own.
pub(super) fn components(rows: &[f64], mean: &[f64], count: usize) -> Vec<f64> {
    let bands = mean.len();
    let mut covariance = vec![0.0; bands * bands];
    for row in rows.chunks_exact(bands) {
        for i in 0..bands {
            let a = row[i] - mean[i];
            for j in 0..bands {
                covariance[i * bands + j] += a * (row[j] - mean[j]);
            }
        }
    }
    let vectors = eigenvectors(&mut covariance, bands);
    let mut order: Vec<usize> = (0..bands).collect();
    let value = |i: usize| covariance[i * bands + i];
    order.sort_by(|&a, &b| value(b).total_cmp(&value(a)));
    let mut out = Vec::with_capacity(count * bands);
    for &i in order.iter().take(count) {
        let vector = &vectors[i * bands..(i + 1) * bands];
        let larger = |largest: f64, &v: &f64| if v.abs() > largest.abs() { v } else { largest };
        let sign = 1.0f64.copysign(vector.iter().fold(0.0, larger));
        out.extend(vector.iter().map(|v| sign * v));
    }
    out
}

/// Leaves the eigenvalues of a symmetric matrix on its diagonal, and returns the vectors as rows.
fn eigenvectors(matrix: &mut [f64], n: usize) -> Vec<f64> {
    let mut vectors = vec![0.0; n * n];
    for i in 0..n {
        vectors[i * n + i] = 1.0;
    }
    for _ in 0..MAX_SWEEPS {
        let all: f64 = matrix.iter().map(|x| x * x).sum();
        let diagonal: f64 = (0..n).map(|i| matrix[i * n + i] * matrix[i * n + i]).sum();
        if all - diagonal <= 1.0e-28 * all {
            break;
        }
        for p in 0..n {
            for q in p + 1..n {
                rotate(matrix, &mut vectors, n, p, q);
            }
        }
    }
    vectors
}

/// The rotation that makes one entry off the diagonal zero.
fn rotate(matrix: &mut [f64], vectors: &mut [f64], n: usize, p: usize, q: usize) {
    let off = matrix[p * n + q];
    if off == 0.0 {
        return;
    }
    let theta = 0.5 * (matrix[q * n + q] - matrix[p * n + p]) / off;
    let t = 1.0f64.copysign(theta) / (theta.abs() + (theta * theta + 1.0).sqrt());
    let c = 1.0 / (t * t + 1.0).sqrt();
    let s = t * c;
    for k in 0..n {
        let (a, b) = (matrix[k * n + p], matrix[k * n + q]);
        matrix[k * n + p] = c * a - s * b;
        matrix[k * n + q] = s * a + c * b;
    }
    for k in 0..n {
        let (a, b) = (matrix[p * n + k], matrix[q * n + k]);
        matrix[p * n + k] = c * a - s * b;
        matrix[q * n + k] = s * a + c * b;
        let (a, b) = (vectors[p * n + k], vectors[q * n + k]);
        vectors[p * n + k] = c * a - s * b;
        vectors[q * n + k] = s * a + c * b;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use farside::random::RandomKey;

    #[test]
    fn vectors_are_orthonormal_and_belong_to_their_values() {
        let n = 12;
        let mut stream = RandomKey::new(1).stream();
        let mut matrix = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..=i {
                matrix[i * n + j] = stream.normal(0.0, 1.0);
                matrix[j * n + i] = matrix[i * n + j];
            }
        }
        let original = matrix.clone();
        let vectors = eigenvectors(&mut matrix, n);
        for a in 0..n {
            let va = &vectors[a * n..(a + 1) * n];
            for b in 0..n {
                let vb = &vectors[b * n..(b + 1) * n];
                let dot: f64 = va.iter().zip(vb).map(|(x, y)| x * y).sum();
                assert!((dot - f64::from(u8::from(a == b))).abs() < 1e-12);
            }
            for i in 0..n {
                let image: f64 = (0..n).map(|j| original[i * n + j] * va[j]).sum();
                assert!((image - matrix[a * n + a] * va[i]).abs() < 1e-10);
            }
        }
    }
}
