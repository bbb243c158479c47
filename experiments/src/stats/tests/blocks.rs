//! Runs that share a problem: what their blocks say, against scipy, and what runs would say.

use farside::random::RandomKey;
use proptest::prelude::*;

use super::{SKEWED, close, key};
use crate::stats::blocks::Pool;
use crate::stats::bootstrap::{self, differences, mean, replicates};
use crate::stats::paired::{holm, student};
use crate::stats::rates::{
    mcnemar, mcnemar_in_blocks, paired_rate_difference, wilson, wilson_in_blocks,
};
use crate::stats::{Blocks, Estimate};

// What `blocks.py` prints, with scipy 1.17.1 and statsmodels 0.15.0.
const SCIPY_BCA: [f64; 3] = [1.759, 1.6266666666666665, 2.0073333333333334];
const STUDENT: [f64; 6] = [
    0.0006132565945527565,
    0.9313804328055871,
    6.618702542498829e-11,
    0.15172597821513323,
    0.2951672353008665,
    0.0034043977226329305,
];
const HOLM: [f64; 7] = [0.06, 0.16, 0.15, 0.035, 0.55, 0.16, 0.4];
const PERMUTATION: f64 = 0.15625;
const WILSON: [f64; 3] = [0.6551724137931034, 0.33495515930578695, 0.8775644434935306];
const WORTH: f64 = 0.5791799222340048;

/// Six blocks of five.
fn skewed() -> Blocks {
    let blocks: Vec<Vec<f64>> = SKEWED.chunks(5).map(<[f64]>::to_vec).collect();
    blocks.into()
}

/// Thirty problems of five runs each, with a correlation of 0.8 among the runs of a problem:
/// bootstraps of problems hold the true mean nearly as often as they say, and bootstraps of runs do
/// not.
#[test]
fn blocks_hold_the_truth_where_runs_do_not() {
    const REPETITIONS: u64 = 2000;
    let holds_zero = |estimate: &Estimate| estimate.low <= 0.0 && 0.0 <= estimate.high;
    let (mut by_blocks, mut by_runs) = (0, 0);
    for repetition in 0..REPETITIONS {
        let mut stream = RandomKey::new(12).number(repetition).stream();
        let (shared_sd, own_sd) = (libm::sqrt(0.8), libm::sqrt(0.2));
        let blocks: Vec<Vec<f64>> = (0..30)
            .map(|_| {
                let problem = stream.normal(0.0, shared_sd);
                (0..5)
                    .map(|_| problem + stream.normal(0.0, own_sd))
                    .collect()
            })
            .collect();
        let draws = RandomKey::new(13).number(repetition);
        // A quarter of them shows it, and takes as long as all by blocks.
        if repetition % 4 == 0 {
            by_runs += u64::from(holds_zero(&mean(&blocks.concat(), draws)));
        }
        by_blocks += u64::from(holds_zero(&mean(blocks, draws)));
    }
    let share = |held: u64, of: u64| held as f64 / of as f64;
    let (blocks, runs) = (
        share(by_blocks, REPETITIONS),
        share(by_runs, REPETITIONS / 4),
    );
    assert!((0.92..=0.97).contains(&blocks), "{blocks}");
    assert!(runs < 0.75, "{runs}");
}

/// `scipy.stats.bootstrap` with method BCa over the means that were drawn here; see `blocks.py`,
/// beside this file, for this and the next values.
#[test]
fn intervals_of_blocks_are_those_of_scipy() {
    close(
        mean(skewed(), key()),
        SCIPY_BCA[0],
        SCIPY_BCA[1],
        SCIPY_BCA[2],
        1e-9,
    );
}

/// Prints the drawn means, for `blocks.py`.
#[test]
#[ignore = "for scipy, not for asserts"]
fn drawn_means() {
    let [means] = replicates(&Pool::new(&[&skewed()]), key(), &[bootstrap::mean_of]);
    println!("{}", serde_json::to_string(&means).unwrap());
}

/// `scipy.stats.ttest_1samp(means of blocks, expected).pvalue`.
#[test]
fn students_test_is_that_of_scipy() {
    let long = Blocks::from(
        &(1..=400)
            .map(|at| 0.01 + f64::from(at % 7 - 3))
            .collect::<Vec<_>>(),
    );
    for (blocks, expected, p) in [
        (skewed(), 1.0, STUDENT[0]),
        (skewed(), 1.75, STUDENT[1]),
        (Blocks::from(&SKEWED), 0.0, STUDENT[2]),
        (Blocks::from(&SKEWED), 1.5, STUDENT[3]),
        (Blocks::from(&[0.5, 1.5]), 0.0, STUDENT[4]),
        (long, 0.3, STUDENT[5]),
    ] {
        let found = student(&blocks, expected);
        assert!((found - p).abs() < 1e-9 * p, "{found}, not {p}");
    }
}

/// `statsmodels.stats.multitest.multipletests(p, method="holm")[1]`.
#[test]
fn holms_method_is_that_of_statsmodels() {
    let p = [0.01, 0.04, 0.03, 0.005, 0.55, 0.04, 0.2];
    for (found, expected) in holm(&p).into_iter().zip(HOLM) {
        assert!((found - expected).abs() < 1e-12, "{found}, not {expected}");
    }
    // What has no p is no part of the family.
    let with_none = [&p[..3], &[f64::NAN], &p[3..]].concat();
    let adjusted = holm(&with_none);
    assert!(adjusted[3].is_nan() && (adjusted[4] - HOLM[3]).abs() < 1e-12);
}

/// Pairs in six blocks, as `blocks.py` has them.
fn pairs() -> Vec<Vec<(bool, bool)>> {
    let block = |here: &str, there: &str| -> Vec<(bool, bool)> {
        let pairs = here.bytes().zip(there.bytes());
        pairs.map(|(a, b)| (a == b'1', b == b'1')).collect()
    };
    vec![
        block("11110", "10000"),
        block("11111", "11011"),
        block("10100", "00100"),
        block("00000", "00010"),
        block("1110", "1100"),
        block("11111", "01010"),
    ]
}

/// `scipy.stats.permutation_test` over the blocks' differences, all of them, and Wilson's interval
/// of statsmodels for as many runs as the design effect leaves.
#[test]
fn rates_in_blocks_are_those_of_scipy() {
    let test = mcnemar_in_blocks(&pairs());
    assert!((test.p - PERMUTATION).abs() < 1e-12, "{}", test.p);
    let here: Vec<Vec<bool>> = pairs()
        .iter()
        .map(|block| block.iter().map(|(here, _)| *here).collect())
        .collect();
    close(
        wilson_in_blocks(&here),
        WILSON[0],
        WILSON[1],
        WILSON[2],
        1e-9,
    );
    assert!((test.worth - WORTH).abs() < 1e-9, "{}", test.worth);
}

#[test]
fn a_single_block_says_nothing_and_equal_ones_are_sure() {
    let one = Blocks::from(vec![vec![1.0, 2.0, 3.0]]);
    assert_eq!(mean(one.clone(), key()), Estimate::unknown(2.0));
    assert!(student(&one, 0.0).is_nan() && holm(&[f64::NAN])[0].is_nan());
    let same = Blocks::from(&[0.1; 7]);
    assert_eq!((student(&same, 0.1), student(&same, 0.0)), (1.0, 0.0));
    // Never in 10 blocks of 3 runs: as if it were 10 runs.
    let never = wilson_in_blocks(&vec![vec![false; 3]; 10]);
    assert_eq!((never.low, never.high), (0.0, wilson(0, 10).high));
    assert!(wilson_in_blocks(&[]).value.is_nan());
    assert_eq!(mcnemar_in_blocks(&[]).p, 1.0);
    let alike = mcnemar_in_blocks(&vec![vec![(true, true); 3]; 10]);
    let difference = paired_rate_difference(&alike);
    assert_eq!((alike.p, difference.value), (1.0, 0.0));
    assert!((difference.high - (1.0 - wilson(10, 10).low)).abs() < 1e-12);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Blocks of one run are what runs are.
    #[test]
    fn blocks_of_one_change_nothing(flags in prop::collection::vec(any::<(bool, bool)>(), 1..60)) {
        let alone: Vec<Vec<(bool, bool)>> = flags.iter().map(|pair| vec![*pair]).collect();
        prop_assert_eq!(mcnemar_in_blocks(&alone), mcnemar(&flags));
        let here: Vec<Vec<bool>> = flags.iter().map(|(here, _)| vec![*here]).collect();
        let happened = flags.iter().filter(|(here, _)| *here).count();
        prop_assert_eq!(wilson_in_blocks(&here), wilson(happened, flags.len()));
    }

    /// An exact randomisation test of single pairs, each in a block with one that says nothing, is
    /// McNemar's.
    #[test]
    fn the_sign_of_a_block_is_what_chance_decides(
        flags in prop::collection::vec(any::<(bool, bool)>(), 1..60),
    ) {
        let blocks: Vec<Vec<(bool, bool)>> =
            flags.iter().map(|pair| vec![*pair, (true, true)]).collect();
        let (blocks, alone) = (mcnemar_in_blocks(&blocks), mcnemar(&flags));
        prop_assert!((blocks.p - alone.p).abs() < 1e-9);
    }

    /// The order of blocks, and that of values in them, changes no bit.
    #[test]
    fn the_order_of_blocks_says_nothing(
        mut blocks in prop::collection::vec(prop::collection::vec(-9.0..9.0f64, 1..5), 2..12),
    ) {
        let before = mean(blocks.clone(), key());
        blocks.reverse();
        for block in &mut blocks {
            block.reverse();
        }
        prop_assert_eq!(mean(blocks.clone(), key()), before);
        let sides: Vec<Vec<(f64, f64)>> = blocks
            .iter()
            .map(|block| block.iter().map(|value| (*value, *value)).collect())
            .collect();
        prop_assert_eq!(student(&differences(&sides), 0.0), 1.0);
    }
}

/// Families of twenty tests that hang together and in which nothing differs: Holm's method finds
/// something in one of twenty at most, where each test alone finds something in every third.
#[test]
fn families_are_held_together() {
    let families = 1000;
    let (mut alone, mut together) = (0, 0);
    for family in 0..families {
        let mut stream = RandomKey::new(14).number(family).stream();
        let shared: Vec<f64> = (0..30).map(|_| stream.normal(0.0, 1.0)).collect();
        let p: Vec<f64> = (0..20)
            .map(|_| {
                let values = shared
                    .iter()
                    .map(|shared| 0.5 * shared + stream.normal(0.0, 1.0));
                student(&Blocks::from(&values.collect::<Vec<_>>()), 0.0)
            })
            .collect();
        let found = |p: &[f64]| u32::from(p.iter().any(|p| *p <= 0.05));
        alone += found(&p);
        together += found(&holm(&p));
    }
    assert!(
        alone > 300 && (10..=60).contains(&together),
        "{alone} {together}"
    );
}
