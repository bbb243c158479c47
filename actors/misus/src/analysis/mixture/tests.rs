//! Mixtures: what a run may never do, what singular data give, and stretched classes.

use farside::random::{RandomKey, Stream};
use proptest::prelude::*;

use super::em::{Run, floors};
use super::*;
use crate::analysis::scores::{adjusted_rand_index, hard};

fn table(stream: &mut Stream, rows: usize, columns: usize, missing: f64) -> Table {
    let mut table = Table::new(columns, columns.min(2) - 1);
    let centres: Vec<f64> = (0..3 * columns).map(|_| stream.normal(0.0, 3.0)).collect();
    let scales: Vec<f64> = (0..columns)
        .map(|_| libm::exp(stream.normal(0.0, 2.0)))
        .collect();
    for _ in 0..rows {
        let class = stream.below(3) as usize;
        let mut values = vec![0.0; columns];
        let mut noise = vec![0.0; columns];
        for d in 0..columns {
            values[d] = scales[d] * (centres[class * columns + d] + stream.normal(0.0, 1.0));
            noise[d] = match (stream.chance(missing), stream.chance(0.5)) {
                (true, _) => f64::INFINITY,
                (_, true) => scales[d] * scales[d] * stream.uniform(),
                _ => 0.0,
            };
        }
        table.push(&values, &noise);
    }
    table
}

/// The log-likelihood as its definition says, term by term.
fn by_definition(mixture: &Mixture, table: &Table) -> f64 {
    let mut sum = 0.0;
    for row in 0..table.len() {
        let mut density = 0.0;
        for class in 0..mixture.classes() {
            let mut term = mixture.weights()[class];
            for d in 0..table.columns() {
                let noise = table.noise(row)[d];
                if noise.is_finite() {
                    let variance = mixture.variance(class)[d] + noise;
                    let z = table.row(row)[d] - mixture.mean(class)[d];
                    let normal = libm::exp(-0.5 * z * z / variance)
                        / (2.0 * std::f64::consts::PI * variance).sqrt();
                    let is_position = d >= table.position_at();
                    let exponent = if is_position {
                        mixture.position_weight()
                    } else {
                        1.0
                    };
                    term *= libm::pow(normal, exponent);
                }
            }
            density += term;
        }
        sum += libm::log(density);
    }
    sum
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn the_objective_never_falls(
        seed: u64,
        rows in 1usize..40,
        columns in 1usize..6,
        classes in 1usize..5,
        missing in 0.0f64..0.6,
        shrinkage in 0.01f64..20.0,
        position_weight in 0.0f64..1.0,
    ) {
        let mut stream = RandomKey::new(seed).stream();
        let table = table(&mut stream, rows, columns, missing);
        let settings = FitSettings { shrinkage, position_weight, ..FitSettings::default() };
        let floors = floors(&table, &settings);
        let mut shares = vec![0.0; rows * classes];
        for row in shares.chunks_exact_mut(classes) {
            row[stream.below(classes as u64) as usize] = 1.0;
        }
        let mut run = Run::new(&table, &settings, &floors, classes, shares);
        let mut before = run.expect() - run.penalty();
        prop_assert!(before.is_finite());
        for step in 0..40 {
            run.maximise();
            let objective = run.expect() - run.penalty();
            let rounding = 1e-9 * (1.0 + before.abs());
            prop_assert!(objective >= before - rounding, "step {step}: {before} to {objective}");
            before = objective;
        }
        prop_assert!((run.mixture.weights().iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_likelihood_is_as_defined(seed: u64, rows in 1usize..20, columns in 1usize..6) {
        let mut stream = RandomKey::new(seed).stream();
        let table = table(&mut stream, rows, columns, 0.3);
        let settings = FitSettings { max_classes: 3, starts: 2, ..FitSettings::default() };
        let fit = fit(&table, &settings).unwrap();
        let expected = by_definition(&fit.mixture, &table);
        let actual = fit.mixture.log_likelihood(&table).unwrap();
        prop_assert!((actual - expected).abs() <= 1e-9 * (1.0 + expected.abs()));
        prop_assert!((fit.chosen.log_likelihood - expected).abs() <= 1e-9 * (1.0 + expected.abs()));
        let shares = fit.mixture.responsibilities(&table).unwrap();
        for row in shares.chunks_exact(fit.mixture.classes()) {
            prop_assert!((row.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn equal_tables_have_bit_equal_mixtures(seed: u64, rows in 1usize..25) {
        let mut stream = RandomKey::new(seed).stream();
        let table = table(&mut stream, rows, 4, 0.2);
        let settings = FitSettings { max_classes: 4, starts: 3, ..FitSettings::default() };
        let [a, b] = [(); 2].map(|()| fit(&table.clone(), &settings).unwrap());
        let bits = |fit: &Fit| fit.mixture.means.iter().map(|m| m.to_bits()).collect::<Vec<_>>();
        prop_assert_eq!(bits(&a), bits(&b));
        prop_assert_eq!(a, b);
    }
}

fn all_finite(fit: &Fit) {
    let Mixture {
        weights,
        means,
        variances,
        tied,
        ..
    } = &fit.mixture;
    let shares = fit.responsibilities.iter();
    let numbers = weights
        .iter()
        .chain(means)
        .chain(variances)
        .chain(tied)
        .chain(shares);
    assert!(numbers.copied().all(f64::is_finite), "{fit:?}");
    for candidate in &fit.tried {
        assert!(candidate.bic.is_finite(), "{candidate:?}");
    }
}

#[test]
fn singular_data_have_an_answer() {
    let settings = FitSettings::default();
    let rows = |rows: &[[f64; 3]]| {
        let mut table = Table::new(3, 2);
        for row in rows {
            table.push(row, &[0.0; 3]);
        }
        fit(&table, &settings)
    };
    assert_eq!(rows(&[]), Err(MixtureError::NoRocks));
    let one = rows(&[[1.0, 2.0, 3.0]]).unwrap();
    assert_eq!(one.mixture.classes(), 1);
    all_finite(&one);
    // Fewer rocks than features, and rocks that are all equal: one class.
    let two = rows(&[[1.0, 2.0, 3.0], [1.0, 2.5, 3.5]]).unwrap();
    all_finite(&two);
    let equal = rows(&[[1.0, 2.0, 3.0]; 30]).unwrap();
    assert_eq!(equal.mixture.classes(), 1);
    all_finite(&equal);
    // A column without a value, and a row without one.
    let mut table = Table::new(3, 2);
    for i in 0..10 {
        let noise = if i == 3 { f64::INFINITY } else { 0.0 };
        table.push(
            &[f64::NAN, f64::from(i), 1.0],
            &[f64::INFINITY, noise, noise],
        );
    }
    all_finite(&fit(&table, &settings).unwrap());
}

#[test]
fn a_score_of_singular_data_does_not_choose_more_classes() {
    // Two places with twenty rocks each, all equal: a class for each rock would have any density.
    let mut table = Table::new(2, 0);
    for i in 0..40 {
        let x = if i % 2 == 0 { 0.0 } else { 1.0 };
        table.push(&[x, -x], &[0.0; 2]);
    }
    let fit = fit(&table, &FitSettings::default()).unwrap();
    all_finite(&fit);
    assert_eq!(fit.mixture.classes(), 2);
}

/// Two classes a thousand times as long as they are apart: k-means cuts them across.
#[test]
fn stretched_classes_are_not_cut() {
    let mut stream = RandomKey::new(4).stream();
    let mut table = Table::new(3, 0);
    let mut truth = Vec::new();
    for i in 0..90 {
        let class = i % 2;
        let values = [
            stream.normal(0.0, 1000.0),
            class as f64 + stream.normal(0.0, 0.1),
            stream.normal(0.0, 30.0),
        ];
        table.push(&values, &[0.0; 3]);
        truth.push(class);
    }
    let fit = fit(&table, &FitSettings::default()).unwrap();
    assert_eq!(fit.mixture.classes(), 2);
    let classes = hard(&fit.responsibilities, 2);
    assert_eq!(adjusted_rand_index(&classes, &truth), 1.0);
}

#[test]
fn settings_out_of_range_are_named() {
    let mut table = Table::new(1, 0);
    table.push(&[1.0], &[0.0]);
    let refused = |settings: FitSettings| fit(&table, &settings).unwrap_err().to_string();
    let settings = FitSettings::default();
    assert_eq!(
        refused(FitSettings {
            position_weight: 1.5,
            ..settings
        }),
        "position_weight must be within 0 and 1; it is 1.5"
    );
    assert_eq!(
        refused(FitSettings {
            shrinkage: f64::NAN,
            ..settings
        }),
        "shrinkage must be finite and over 0; it is NaN"
    );
    assert_eq!(
        refused(FitSettings {
            max_classes: 1,
            min_classes: 2,
            ..settings
        }),
        "max_classes must be at least min_classes; it is 1"
    );
    let other = Table::new(2, 0);
    let learnt = fit(&table, &settings).unwrap();
    assert_eq!(
        learnt
            .mixture
            .log_likelihood(&other)
            .unwrap_err()
            .to_string(),
        "the table has 2 columns, must have 1 as the mixture"
    );
}
