//! When a cell has seeds enough. The decision depends on the outcomes of the cell's first seeds
//! and on nothing else, so it is the same however runs were interrupted, ordered or parted.

use super::results::Stop;
use crate::stats::{Blocks, Z_95 as Z, rates};

/// What a run says about the metric that decides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Sample {
    /// A number.
    Number(f64),
    /// True or false: a rate is measured.
    Flag(bool),
    /// Nothing: the run failed, or the metric has no value in it.
    None,
}

/// How many seeds the cell is to have, of at most `max`, as far as `samples` (by seed, none for a
/// run that is not yet done) can tell. More done runs may raise it, and never lower it. Of seeds in
/// blocks, whole blocks are taken.
pub(super) fn target(stop: &Stop, max: usize, block: usize, samples: &[Option<Sample>]) -> usize {
    let mut look = stop.min_seeds.min(max);
    while look < max {
        let first: Option<Vec<Sample>> = samples[..look].iter().copied().collect();
        match first {
            // Not all there yet, or enough.
            None => return look,
            Some(first) if width(&first, block) <= stop.width => return look,
            // Half as many again: a look at each seed would stop at the first lucky one.
            Some(_) => {
                look = (look + look.div_ceil(2))
                    .next_multiple_of(block.max(1))
                    .min(max)
            }
        }
    }
    look
}

/// The width of the metric's 95 % interval: Student's for the mean of the blocks' means of numbers,
/// Wilson's for a rate.
fn width(samples: &[Sample], block: usize) -> f64 {
    let blocks = || samples.chunks(block.max(1));
    let flags = |block: &[Sample]| -> Vec<bool> {
        let flags = block.iter().filter_map(|sample| match sample {
            Sample::Flag(flag) => Some(*flag),
            _ => None,
        });
        flags.collect()
    };
    let flags: Vec<Vec<bool>> = blocks().map(flags).collect();
    if flags.iter().any(|block| !block.is_empty()) {
        return rates::wilson_in_blocks(&flags).width();
    }
    let numbers = |block: &[Sample]| -> Vec<f64> {
        let numbers = block.iter().filter_map(|sample| match sample {
            Sample::Number(number) => Some(*number),
            _ => None,
        });
        numbers.collect()
    };
    let numbers: Vec<Vec<f64>> = blocks().map(numbers).collect();
    student_width(&Blocks::from(numbers).means())
}

fn student_width(numbers: &[f64]) -> f64 {
    if numbers.len() < 2 {
        return f64::INFINITY;
    }
    let n = numbers.len() as f64;
    let mean = numbers.iter().sum::<f64>() / n;
    let squares: f64 = numbers.iter().map(|x| (x - mean) * (x - mean)).sum();
    2.0 * student_quantile(n - 1.0) * (squares / (n - 1.0) / n).sqrt()
}

/// The 97.5 % quantile of Student's distribution (Cornish and Fisher's series; 0.3 % too small at
/// 4 degrees of freedom, the fewest that studies ask for, and better beyond).
fn student_quantile(freedom: f64) -> f64 {
    let z3 = Z * Z * Z;
    let z5 = z3 * Z * Z;
    let z7 = z5 * Z * Z;
    let first = (z3 + Z) / (4.0 * freedom);
    let second = (5.0 * z5 + 16.0 * z3 + 3.0 * Z) / (96.0 * freedom * freedom);
    let third =
        (3.0 * z7 + 19.0 * z5 + 17.0 * z3 - 15.0 * Z) / (384.0 * freedom * freedom * freedom);
    Z + first + second + third
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stop(width: f64) -> Stop {
        Stop {
            metric: "x".to_owned(),
            width,
            min_seeds: 5,
        }
    }

    #[test]
    fn quantiles_are_those_of_tables() {
        for (freedom, table) in [(4.0, 2.776), (9.0, 2.262), (29.0, 2.045), (1e6, 1.960)] {
            let quantile = student_quantile(freedom);
            assert!(
                (quantile / table - 1.0).abs() < 0.003,
                "{freedom}: {quantile}"
            );
        }
        // Wilson's interval for 0 of 30 is [0, 0.1135].
        assert!((width(&[Sample::Flag(false); 30], 1) - 0.1135).abs() < 1e-4);
    }

    #[test]
    fn a_cell_goes_on_until_its_interval_is_narrow() {
        let noisy: Vec<_> = (0..40)
            .map(|i| Some(Sample::Number(f64::from(i % 2))))
            .collect();
        assert_eq!(target(&stop(1e-9), 40, 1, &noisy), 40);
        assert_eq!(target(&stop(10.0), 40, 1, &noisy), 5);
        let between = target(&stop(0.6), 40, 1, &noisy);
        assert!([8, 12, 18, 27].contains(&between), "{between}");
        // What is not done yet cannot decide.
        let mut gap = noisy.clone();
        gap[6] = None;
        assert_eq!(target(&stop(0.6), 40, 1, &gap), 8);
        let failed = vec![Some(Sample::None); 40];
        assert_eq!(target(&stop(10.0), 40, 1, &failed), 40);
        assert_eq!(target(&stop(10.0), 3, 1, &noisy), 3);
    }

    #[test]
    fn whole_blocks_are_looked_at_and_counted() {
        let mut noisy: Vec<_> = (0..40)
            .map(|i| Some(Sample::Number(f64::from(i % 2))))
            .collect();
        noisy[13] = None;
        let wide = |block| Stop {
            min_seeds: 8,
            ..stop(if block == 1 { 1e-9 } else { -1.0 })
        };
        // 8, 12 and then 18, or whole blocks of 4.
        assert_eq!(target(&wide(1), 40, 1, &noisy), 18);
        assert_eq!(target(&wide(4), 40, 4, &noisy), 20);
        // Twelve runs that say three things are three witnesses.
        let shared: Vec<Sample> = (0..12).map(|i| Sample::Number(f64::from(i / 4))).collect();
        assert!(width(&shared, 4) > 2.0 * width(&shared, 1));
        let flags: Vec<Sample> = (0..12).map(|i| Sample::Flag(i < 4)).collect();
        assert!(width(&flags, 4) > 1.4 * width(&flags, 1));
    }
}
